// The error function.
#ifndef ERROR_FUNCTION_GLSL
#define ERROR_FUNCTION_GLSL

// erf(x) for |x| <= 3.9, where it is 1 to 4e-8: a rational minimax approximation of our own, 1.5e-8 in exact arithmetic, 1.3e-7 of the value
// near 0.
float error_function(float x) {
    float t = x * x;
    float p = 1.128379033 + t * (0.191938896 + t * (0.05296663945 + t * (0.00383677821 + t * (0.0002874535484 + t * 2.05038806e-6))));
    float q = 1.0 + t * (0.5034331993 + t * (0.1147573233 + t * (0.01510902055 + t * (0.001181707254 + t * 3.823054692e-5))));
    return x * p / q;
}

#endif
