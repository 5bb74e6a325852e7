//! Rewrites shaders so that they find large buffers by address. A descriptor shows a shader `maxStorageBufferRange` bytes of a buffer,
//! 128 MiB with some drivers; an address shows all of it (`bufferDeviceAddress`).
//!
//! The variable of a storage block becomes a pointer of the class `PhysicalStorageBuffer`, which each function reads from a uniform block
//! of addresses. Pointers into the block change their class with it, and loads and stores by them get an alignment.
//!
//! Source: the SPIR-V specification 1.5, with `SPV_KHR_physical_storage_buffer`, which is part of it.

use std::collections::{BTreeMap, BTreeSet};
use std::iter;

/// Binding of the addresses, eight bytes each, in the order of the bindings that they replace. (`glsl/interface.glsl` has lower numbers.)
pub(super) const ADDRESSES: u32 = 1000;

// Instructions, storage classes and decorations of SPIR-V 1.5 that the rewriting looks at.
const OP_NAME: u32 = 5;
const OP_LINE: u32 = 8;
const OP_MEMORY_MODEL: u32 = 14;
const OP_ENTRY_POINT: u32 = 15;
const OP_CAPABILITY: u32 = 17;
const OP_TYPE_VOID: u32 = 19;
const OP_TYPE_INT: u32 = 21;
const OP_TYPE_VECTOR: u32 = 23;
const OP_TYPE_STRUCT: u32 = 30;
const OP_TYPE_POINTER: u32 = 32;
const OP_TYPE_FUNCTION: u32 = 33;
const OP_CONSTANT: u32 = 43;
const OP_FUNCTION: u32 = 54;
const OP_FUNCTION_END: u32 = 56;
const OP_FUNCTION_CALL: u32 = 57;
const OP_VARIABLE: u32 = 59;
const OP_LOAD: u32 = 61;
const OP_STORE: u32 = 62;
const OP_COPY_MEMORY: u32 = 63;
const OP_ACCESS_CHAIN: u32 = 65;
const OP_IN_BOUNDS_ACCESS_CHAIN: u32 = 66;
const OP_PTR_ACCESS_CHAIN: u32 = 67;
const OP_ARRAY_LENGTH: u32 = 68;
const OP_DECORATE: u32 = 71;
const OP_MEMBER_DECORATE: u32 = 72;
const OP_COPY_OBJECT: u32 = 83;
const OP_BITCAST: u32 = 124;
const OP_SELECT: u32 = 169;
const OP_PHI: u32 = 245;
const OP_LABEL: u32 = 248;

const PHYSICAL_STORAGE_BUFFER_ADDRESSES: u32 = 5347;
const PHYSICAL_STORAGE_BUFFER_64: u32 = 5348;
const CLASS_UNIFORM: u32 = 2;
const CLASS_STORAGE_BUFFER: u32 = 12;
const CLASS_PHYSICAL_STORAGE_BUFFER: u32 = 5349;
const DECORATION_BLOCK: u32 = 2;
const DECORATION_BINDING: u32 = 33;
const DECORATION_DESCRIPTOR_SET: u32 = 34;
const DECORATION_OFFSET: u32 = 35;
const ALIGNED: u32 = 2;

/// An instruction: its operation and its operands.
type Instruction = (u32, Vec<u32>);

/// Returns the module with the storage blocks of `bindings`, ascending, found by address; `None` where a shader does with a block what
/// addresses do not allow.
pub(super) fn by_address(words: &[u32], bindings: &[u32]) -> Option<Vec<u32>> {
    let (header, mut body) = (words.get(..5)?, Vec::new());
    let mut at = 5;
    while at < words.len() {
        let length = usize::try_from(words[at] >> 16).ok()?;
        body.push((words[at] & 0xffff, words.get(at + 1..at + length.max(1))?.to_vec()));
        at += length.max(1);
    }
    let mut module = Rewriting::new(header[3], &body, bindings);
    if module.blocks.is_empty() {
        return Some(words.to_vec());
    }
    let rewritten = module.rewrite(&body)?;
    let mut result = header.to_vec();
    result[3] = module.bound;
    for (op, operands) in rewritten {
        result.push(u32::try_from(operands.len() + 1).ok()? << 16 | op);
        result.extend(operands);
    }
    Some(result)
}

/// A storage block that is found by address.
struct Block {
    /// Its place among the addresses.
    place: u32,
    /// The type of pointers to it.
    pointer: u32,
}

/// The identifiers that a rewriting needs, and those that it makes.
struct Rewriting {
    /// All identifiers are below it.
    bound: u32,
    /// Blocks by the variables that they were.
    blocks: BTreeMap<u32, Block>,
    /// Operation and operands of each type.
    types: BTreeMap<u32, Instruction>,
    /// Types of pointers into storage blocks, and those of the same parts by address.
    moved: BTreeMap<u32, u32>,
    /// Number of addresses.
    addresses: u32,
    /// The uniform block of addresses, each a pair of words; the type of a pair and of a pointer to one; the constants 0, 1, ...
    table: u32,
    pair: u32,
    pair_pointer: u32,
    indices: Vec<u32>,
}

impl Rewriting {
    fn new(bound: u32, body: &[Instruction], bindings: &[u32]) -> Self {
        let mut module = Self {
            bound,
            blocks: BTreeMap::new(),
            types: BTreeMap::new(),
            moved: BTreeMap::new(),
            addresses: u32::try_from(bindings.len()).unwrap_or(u32::MAX),
            table: 0,
            pair: 0,
            pair_pointer: 0,
            indices: Vec::new(),
        };
        let mut places = BTreeMap::new();
        for (op, operands) in body {
            match (*op, &operands[..]) {
                (OP_DECORATE, [id, DECORATION_BINDING, binding]) => {
                    let place = bindings.iter().position(|other| other == binding);
                    places.extend(place.and_then(|place| Some((*id, u32::try_from(place).ok()?))));
                }
                (OP_TYPE_VOID..=OP_TYPE_FUNCTION, [id, rest @ ..]) => {
                    drop(module.types.insert(*id, (*op, rest.to_vec())))
                }
                (OP_VARIABLE, [pointer, id, CLASS_STORAGE_BUFFER, ..]) => {
                    if let Some(&place) = places.get(id) {
                        module.blocks.insert(*id, Block { place, pointer: *pointer });
                    }
                }
                _ => {}
            }
        }
        module
    }

    /// Returns a new identifier.
    fn make(&mut self) -> u32 {
        self.bound += 1;
        self.bound - 1
    }

    /// Returns the identifier of a type, which is declared if the module has none: scalars and vectors must not be declared twice.
    fn type_of(&mut self, op: u32, operands: &[u32], declared: &mut Vec<Instruction>) -> u32 {
        let found = self.types.iter().find(|(_, (other, rest))| *other == op && rest == operands);
        if let Some((&id, _)) = found {
            return id;
        }
        let id = self.make();
        self.types.insert(id, (op, operands.to_vec()));
        declared.push((op, iter::once(id).chain(operands.iter().copied()).collect()));
        id
    }

    fn rewrite(&mut self, body: &[Instruction]) -> Option<Vec<Instruction>> {
        self.table = self.make();
        let layout = self.make();
        let first_type = body.iter().position(|(op, _)| (OP_TYPE_VOID..=OP_TYPE_FUNCTION).contains(op))?;
        let first_function = body.iter().position(|(op, _)| *op == OP_FUNCTION)?;
        let mut to: Vec<Instruction> = vec![(OP_CAPABILITY, vec![PHYSICAL_STORAGE_BUFFER_ADDRESSES])];
        for (op, operands) in &body[..first_type] {
            match (*op, &operands[..]) {
                (OP_MEMORY_MODEL, [_, memory]) => to.push((*op, vec![PHYSICAL_STORAGE_BUFFER_64, *memory])),
                (OP_ENTRY_POINT, [kind, entry, rest @ ..]) => {
                    // After its name an entry lists the variables that it uses.
                    let name = rest.iter().position(|word| word.to_le_bytes().contains(&0))? + 1;
                    let used = rest[name..].iter().filter(|id| !self.blocks.contains_key(id));
                    let head = [*kind, *entry].into_iter().chain(rest[..name].iter().copied());
                    to.push((*op, head.chain(used.copied()).chain([self.table]).collect()));
                }
                (OP_NAME | OP_DECORATE, [id, ..]) if self.blocks.contains_key(id) => {}
                _ => to.push((*op, operands.clone())),
            }
        }
        to.push((OP_DECORATE, vec![layout, DECORATION_BLOCK]));
        let offsets = (0..self.addresses).map(|i| vec![layout, i, DECORATION_OFFSET, 8 * i]);
        to.extend(offsets.map(|operands| (OP_MEMBER_DECORATE, operands)));
        to.push((OP_DECORATE, vec![self.table, DECORATION_DESCRIPTOR_SET, 0]));
        to.push((OP_DECORATE, vec![self.table, DECORATION_BINDING, ADDRESSES]));
        for (op, operands) in &body[first_type..first_function] {
            if matches!((*op, &operands[..]), (OP_VARIABLE, [_, id, ..]) if self.blocks.contains_key(id)) {
                continue;
            }
            to.push((*op, operands.clone()));
            if let (OP_TYPE_POINTER, [id, CLASS_STORAGE_BUFFER, target]) = (*op, &operands[..]) {
                let moved = self.type_of(OP_TYPE_POINTER, &[CLASS_PHYSICAL_STORAGE_BUFFER, *target], &mut to);
                self.moved.insert(*id, moved);
            }
        }
        let word = self.type_of(OP_TYPE_INT, &[32, 0], &mut to);
        self.pair = self.type_of(OP_TYPE_VECTOR, &[word, 2], &mut to);
        self.pair_pointer = self.type_of(OP_TYPE_POINTER, &[CLASS_UNIFORM, self.pair], &mut to);
        let members = iter::repeat_n(self.pair, usize::try_from(self.addresses).ok()?);
        to.push((OP_TYPE_STRUCT, iter::once(layout).chain(members).collect()));
        let pointer = self.type_of(OP_TYPE_POINTER, &[CLASS_UNIFORM, layout], &mut to);
        to.push((OP_VARIABLE, vec![pointer, self.table, CLASS_UNIFORM]));
        for place in 0..self.addresses {
            let index = self.make();
            to.push((OP_CONSTANT, vec![word, index, place]));
            self.indices.push(index);
        }
        let functions = body[first_function..].split_inclusive(|(op, _)| *op == OP_FUNCTION_END);
        for function in functions {
            self.rewrite_function(function, &mut to)?;
        }
        Some(to)
    }

    /// Appends a function that finds the blocks by address.
    fn rewrite_function(&mut self, function: &[Instruction], to: &mut Vec<Instruction>) -> Option<()> {
        let used: BTreeSet<u32> = function.iter().flat_map(|(_, operands)| operands).copied().collect();
        // Variables come first.
        let label = function.iter().position(|(op, _)| *op == OP_LABEL)?;
        let variables =
            function[label + 1..].iter().take_while(|(op, _)| matches!(*op, OP_VARIABLE | OP_LINE));
        let begin = label + 1 + variables.count();
        to.extend_from_slice(&function[..begin]);
        // Pointers into blocks, by the identifiers that the function has for them, with their types.
        let mut far = BTreeMap::new();
        for variable in self.blocks.keys().copied().collect::<Vec<_>>() {
            if !used.contains(&variable) {
                continue;
            }
            let Block { place, pointer } = self.blocks[&variable];
            let (from, pair, block) = (self.make(), self.make(), self.make());
            let index = *self.indices.get(usize::try_from(place).ok()?)?;
            let kind = *self.moved.get(&pointer)?;
            to.push((OP_ACCESS_CHAIN, vec![self.pair_pointer, from, self.table, index]));
            to.push((OP_LOAD, vec![self.pair, pair, from]));
            to.push((OP_BITCAST, vec![kind, block, pair]));
            far.insert(variable, (block, kind));
        }
        for (op, operands) in &function[begin..] {
            let mut operands = operands.clone();
            match (*op, &mut operands[..]) {
                (OP_ACCESS_CHAIN | OP_IN_BOUNDS_ACCESS_CHAIN, [kind, id, base, ..]) => {
                    if let Some((block, _)) = far.get(base) {
                        (*base, *kind) = (*block, *self.moved.get(kind)?);
                        far.insert(*id, (*id, *kind));
                    }
                }
                (OP_LOAD, [_, _, pointer, ..]) => {
                    let kind = far.get(pointer).map(|(_, kind)| *kind);
                    self.align(&mut operands, 3, kind)?;
                }
                (OP_STORE, [pointer, ..]) => {
                    let kind = far.get(pointer).map(|(_, kind)| *kind);
                    self.align(&mut operands, 2, kind)?;
                }
                (
                    OP_FUNCTION_CALL | OP_COPY_MEMORY | OP_PTR_ACCESS_CHAIN | OP_ARRAY_LENGTH
                    | OP_COPY_OBJECT | OP_SELECT | OP_PHI,
                    ids,
                ) if ids.iter().any(|id| far.contains_key(id)) => return None,
                _ => {}
            }
            to.push((*op, operands));
        }
        Some(())
    }

    /// Adds the alignment of what a pointer of type `kind` points at to a load or a store, whose memory operands begin at `at`.
    fn align(&self, operands: &mut Vec<u32>, at: usize, kind: Option<u32>) -> Option<()> {
        let Some(kind) = kind else { return Some(()) };
        if operands.len() > at {
            return None;
        }
        let (_, pointer) = self.types.get(&kind)?;
        // std430 aligns vectors of three and four words to four; others may be parts of structures.
        let alignment = match self.types.get(pointer.get(1)?)? {
            (OP_TYPE_VECTOR, rest) => match rest.get(1)? {
                2 => 8,
                _ => 16,
            },
            _ => 4,
        };
        operands.extend([ALIGNED, alignment]);
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::shader::{BINS_EMIT, HAVS_TILES, RAYCAST_COMPUTE};

    /// BINDING_LINE_BOUNDS, of which shaders ask for the length.
    const LINE_BOUNDS: u32 = 49;

    /// Returns the storage classes of the variables of a module.
    fn classes(words: &[u32]) -> Vec<u32> {
        let (mut classes, mut at) = (Vec::new(), 5);
        while at < words.len() {
            if words[at] & 0xffff == OP_VARIABLE {
                classes.push(words[at + 3]);
            }
            at += (words[at] >> 16) as usize;
        }
        classes
    }

    /// The blocks that are named are no variables any more, others are. (That drivers take the modules, and draw the same, is tested by
    /// the techniques.)
    #[test]
    fn named_blocks_are_found_by_address() {
        for shader in [BINS_EMIT.shader(), HAVS_TILES.shader()] {
            let words = shader.words();
            let storage =
                |words: &[u32]| classes(words).iter().filter(|c| **c == CLASS_STORAGE_BUFFER).count();
            let blocks: Vec<u32> = shader
                .bindings
                .iter()
                .filter(|(_, kind)| *kind == ash::vk::DescriptorType::STORAGE_BUFFER)
                .map(|&(binding, _)| binding)
                .filter(|&binding| binding != LINE_BOUNDS)
                .collect();
            assert_eq!(by_address(&words, &[]).unwrap(), words);
            let rewritten = by_address(&words, &blocks[1..]).unwrap();
            assert!(storage(&words) >= blocks.len() && blocks.len() > 3);
            assert_eq!(storage(&rewritten), storage(&words) - (blocks.len() - 1), "{}", shader.name);
            let uniform = |words: &[u32]| classes(words).iter().filter(|c| **c == CLASS_UNIFORM).count();
            assert_eq!(uniform(&rewritten), uniform(&words) + 1, "{}", shader.name);
        }
    }

    /// An address does not tell how long a buffer is.
    #[test]
    fn a_block_whose_length_is_asked_for_is_refused() {
        let words = RAYCAST_COMPUTE.shader().words();
        assert!(RAYCAST_COMPUTE.shader().bindings.iter().any(|(binding, _)| *binding == LINE_BOUNDS));
        assert_eq!(by_address(&words, &[LINE_BOUNDS]), None);
    }
}
