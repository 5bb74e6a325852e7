// One code for each brick of a grid, several in a word: a bit that says whether anything is visible in it, or the upper half of a float not below
// its greatest scalar. x is fastest, and BRICK_ROW divides the codes of a row, so that none of its words has codes of another row.
#ifndef BRICK_CODES_GLSL
#define BRICK_CODES_GLSL

#include "interface.glsl"

// Returns the codes of a row of so many bricks.
int row_of(int across) {
    return (across + BRICK_ROW - 1) / BRICK_ROW * BRICK_ROW;
}

// Returns the bit of a brick from its word, number / 32.
bool bit_of(uint word, int number) {
    return (word >> (uint(number) & 31u) & 1u) != 0u;
}

// Returns a scalar not below any of a brick from its word, number / 2.
float greatest_of(uint word, int number) {
    return uintBitsToFloat((number & 1) == 0 ? word << 16 : word & 0xffff0000u);
}

#endif
