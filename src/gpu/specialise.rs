//! Specialisation of SPIR-V: modules in which the values of specialisation constants are fixed.

use std::collections::BTreeMap;

use super::pipeline::SpecConstant;

/// Words before the first instruction.
const HEADER: usize = 5;

const OP_CONSTANT_TRUE: u32 = 41;
const OP_CONSTANT_FALSE: u32 = 42;
const OP_CONSTANT: u32 = 43;
const OP_CONSTANT_COMPOSITE: u32 = 44;
const OP_SPEC_CONSTANT_TRUE: u32 = 48;
const OP_SPEC_CONSTANT_FALSE: u32 = 49;
const OP_SPEC_CONSTANT: u32 = 50;
const OP_SPEC_CONSTANT_COMPOSITE: u32 = 51;
const OP_DECORATE: u32 = 71;
const DECORATION_SPEC_ID: u32 = 1;

/// Returns the instructions of a module; each begins with its length and code.
fn instructions(words: &[u32]) -> impl Iterator<Item = &[u32]> {
    let mut rest = words.get(HEADER..).unwrap_or_default();
    std::iter::from_fn(move || {
        let length = usize::try_from(rest.first()? >> 16).ok()?.max(1);
        let (one, others) = rest.split_at_checked(length)?;
        rest = others;
        Some(one)
    })
}

/// Returns the numbers of the constants by the identifiers that have them.
fn numbers(words: &[u32]) -> BTreeMap<u32, u32> {
    let number = |one: &[u32]| match one {
        [op, id, DECORATION_SPEC_ID, number] if op & 0xffff == OP_DECORATE => Some((*id, *number)),
        _ => None,
    };
    instructions(words).filter_map(number).collect()
}

/// Returns the numbers of the specialisation constants that a module declares.
pub(super) fn constants_of(words: &[u32]) -> Vec<u32> {
    numbers(words).into_values().collect()
}

/// Returns a module whose specialisation constants are constants of these values, or of their defaults. Operations on constants
/// stay.
pub(super) fn specialised(words: &[u32], values: &[SpecConstant]) -> Vec<u32> {
    let numbers = numbers(words);
    let given = |id: u32| {
        let number = numbers.get(&id)?;
        values.iter().find(|(other, _)| other == number).map(|(_, value)| *value)
    };
    let mut out = words.get(..HEADER).unwrap_or_default().to_vec();
    for one in instructions(words) {
        let op = one[0] & 0xffff;
        let coded = |op: u32| one[0] & !0xffff | op;
        match (op, one) {
            (OP_DECORATE, [_, _, DECORATION_SPEC_ID, _]) => {}
            (OP_SPEC_CONSTANT_TRUE | OP_SPEC_CONSTANT_FALSE, [_, ty, id]) => {
                let value = given(*id).map_or(op == OP_SPEC_CONSTANT_TRUE, |value| value != 0);
                out.extend([coded(if value { OP_CONSTANT_TRUE } else { OP_CONSTANT_FALSE }), *ty, *id]);
            }
            (OP_SPEC_CONSTANT, [_, ty, id, value]) => {
                out.extend([coded(OP_CONSTANT), *ty, *id, given(*id).unwrap_or(*value)]);
            }
            (OP_SPEC_CONSTANT_COMPOSITE, _) => {
                out.push(coded(OP_CONSTANT_COMPOSITE));
                out.extend(&one[1..]);
            }
            _ => out.extend(one),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::shader::SLABS_COMPUTE;

    #[test]
    fn a_specialised_module_has_the_values_and_no_specialisation_constants() {
        let words = SLABS_COMPUTE.shader().words();
        let declared = constants_of(&words);
        assert!(declared.len() > 10, "{declared:?}");
        let values: Vec<SpecConstant> = declared.iter().map(|&number| (number, number % 2)).collect();
        let fixed = specialised(&words, &values);
        assert!(constants_of(&fixed).is_empty());
        assert!(instructions(&fixed).all(|one| !(48..=51).contains(&(one[0] & 0xffff))));
        // Every constant has its value; one instruction less for each number.
        let length = |words: &[u32]| instructions(words).count();
        assert_eq!(length(&words) - length(&fixed), declared.len());
        for (id, number) in numbers(&words) {
            let one = instructions(&fixed)
                .find(|one| one.len() > 2 && (41..=44).contains(&(one[0] & 0xffff)) && one[2] == id);
            let value = match one.unwrap() {
                [op, _, _] => u32::from(op & 0xffff == OP_CONSTANT_TRUE),
                [.., value] => *value,
                [] => unreachable!(),
            };
            assert_eq!(value, number % 2, "constant {number}");
        }
    }
}
