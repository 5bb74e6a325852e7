//! Compiles the shaders of `glsl/` to SPIR-V and writes `shaders.rs`:
//!
//! - the modules, each with the type of its inputs: a structure of its resources and specialisation constants by name, in
//!   which the inputs that a header declares are a structure of their own;
//! - compile-time assertions that the Rust structures of `src/interface.rs` have the layout that the shaders read.
//!
//! The numbers of `glsl/interface.glsl` become `constants.rs`.
//!
//! `layout(constant_id = OPTION_STEP_SIZE)` declares a specialisation constant that takes the value of the technique's option
//! `step-size`, and `DEVICE_TURNS` one that takes a property of the device: such constants are numbered here, and are listed with the module
//! instead of its inputs.
//!
//! A file with `// entry` lines becomes one module for each of them, named for the file's stem and the entry. The word `precise`
//! after an entry has all its variants round alike. Other files are headers. The path in an `#include` starts at `glsl/`.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Ends the build with one line that Cargo shows as an error.
macro_rules! refuse {
    ($($arg:tt)*) => {{
        println!("cargo::error={}", format!($($arg)*).trim_end().replace('\n', " | "));
        std::process::exit(1)
    }};
}

fn main() {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    let folder = root.join("glsl");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=SHADERC_LIB_DIR");

    let mut files = Vec::new();
    walk(&folder, &mut files);
    files.sort();
    refuse_equal_stems(&files);

    let compiler = shaderc::Compiler::new().unwrap_or_else(|error| {
        refuse!("the GLSL compiler does not start ({error}): run `make setup`, which installs libshaderc")
    });
    // Debug builds keep names and line numbers for the validation layers' messages.
    let optimise = env::var("PROFILE").is_ok_and(|profile| profile == "release");

    let mut numbers = String::from("// Written by build.rs from glsl/interface.glsl.\n\n");
    let numbered = constants(&read(&folder.join("interface.glsl")), &mut numbers);
    let given = given_constants(&files);
    write(&out.join("constants.rs"), numbers);
    let mut rust = String::from("// Written by build.rs from glsl/.\n\n");
    let own = numbered.iter().filter(|((is_constant, _), _)| *is_constant);
    let own = own.map(|((_, number), (name, _))| (*number, name.as_str()));
    let given_names = given.iter().zip(FIRST_GIVEN..).map(|(name, number)| (number, name.as_str()));
    let names: Vec<(u32, &str)> = own.chain(given_names).collect();
    let _ = writeln!(
        rust,
        "/// Numbers of all specialisation constants, with their names.\npub(super) const SPEC_NAMES: &[(u32, &str)] = &{names:?};\n"
    );
    let mut layouts = BTreeMap::new();
    let mut inputs = AllInputs::default();
    for file in &files {
        let source = Source { folder: &folder, file, text: read(file), given: &given };
        let mut headers = Vec::new();
        collect_headers(&folder, &source.text, &mut headers);
        for (stage, entry, precise) in source.entries() {
            let name = format!("{}_{entry}", stem(file)).to_uppercase().replace('-', "_");
            // Names are read from the plain module: optimisation strips them.
            let plain = source.compile(&compiler, stage, &entry, false);
            let module = Module::parse(&plain);
            module.layouts(file, &mut layouts);
            let shipped = if optimise {
                let optimised = source.compile(&compiler, stage, &entry, true);
                refuse_slow_searches(&name, &optimised);
                optimised
            } else {
                plain
            };
            let shipped = if precise { rounded_as_written(&shipped) } else { shipped };
            let bytes: Vec<u8> = shipped.iter().flat_map(|word| word.to_le_bytes()).collect();
            write(&out.join(format!("{name}.spv")), bytes);
            let fields = module.fields(&name, &numbered);
            let description = module.describe(&name, stage, &given);
            inputs.add(&stem(file), [entry, name, description], fields, &headers);
        }
    }
    inputs.write(&mut rust);
    assertions(&layouts, &mut rust);
    write(&out.join("shaders.rs"), rust);
}

/// Collects the GLSL files of a folder and of the folders in it, and has Cargo watch them all.
fn walk(folder: &Path, files: &mut Vec<PathBuf>) {
    // A watched folder is built again when a file is added or removed.
    println!("cargo::rerun-if-changed={}", folder.display());
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    for entry in entries.unwrap_or_else(|error| refuse!("{}: {error}", folder.display())) {
        let path = entry.path();
        if path.is_dir() {
            // Some shaders are for a feature only.
            let feature = match path.file_name().and_then(|name| name.to_str()) {
                Some("window") => Some("CARGO_FEATURE_CLI"),
                Some("faults") => Some("CARGO_FEATURE_TESTING"),
                Some("peak") => Some("CARGO_FEATURE_CLI"),
                _ => None,
            };
            if feature.is_none_or(|feature| env::var_os(feature).is_some()) {
                walk(&path, files);
            }
        } else if path.extension().is_some_and(|extension| extension == "glsl") {
            println!("cargo::rerun-if-changed={}", path.display());
            files.push(path);
        }
    }
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| refuse!("{}: {error}", path.display()))
}

fn write(path: &Path, content: impl AsRef<[u8]>) {
    fs::write(path, content).unwrap_or_else(|error| refuse!("{}: {error}", path.display()));
}

fn stem(file: &Path) -> String {
    file.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Refuses two files of one stem: names of modules come from stems, whatever the folder.
fn refuse_equal_stems(files: &[PathBuf]) {
    let mut stems = BTreeMap::new();
    for file in files {
        if let Some(other) = stems.insert(stem(file), file) {
            refuse!("{} and {}: the names of shader files must differ", other.display(), file.display());
        }
    }
}

/// A file with entries.
struct Source<'a> {
    folder: &'a Path,
    file: &'a Path,
    text: String,
    given: &'a [String],
}

impl Source<'_> {
    /// Returns stage and macro of the `// entry <stage> <MACRO> [precise]` lines at the top of the file, and whether they are
    /// precise.
    fn entries(&self) -> Vec<(shaderc::ShaderKind, String, bool)> {
        let entry = |line: &str| {
            let refuse = |why: &str| -> ! { refuse!("{}: `{line}`: {why}", self.file.display()) };
            let mut words = line.strip_prefix("// entry ")?.split_whitespace();
            let stage = match words.next() {
                Some("vertex") => shaderc::ShaderKind::Vertex,
                Some("fragment") => shaderc::ShaderKind::Fragment,
                Some("compute") => shaderc::ShaderKind::Compute,
                _ => refuse("the stage must be vertex, fragment or compute"),
            };
            let Some(entry) = words.next() else { refuse("no macro is named") };
            let precise = match words.next() {
                None => false,
                Some("precise") => true,
                Some(_) => refuse("the macro may be followed by `precise` only"),
            };
            Some((stage, entry.to_string(), precise))
        };
        self.text.lines().filter_map(entry).collect()
    }

    fn compile(
        &self,
        compiler: &shaderc::Compiler,
        stage: shaderc::ShaderKind,
        entry: &str,
        optimise: bool,
    ) -> Vec<u32> {
        let Ok(mut options) = shaderc::CompileOptions::new() else {
            refuse!("the GLSL compiler gives no options object: run `make setup`")
        };
        options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
        // 1.5, not 1.6: Mesa 22.3's software driver crashes on gl_HelperInvocation in 1.6.
        options.set_target_spirv(shaderc::SpirvVersion::V1_5);
        options.set_warnings_as_errors();
        if optimise {
            options.set_optimization_level(shaderc::OptimizationLevel::Performance);
        } else {
            options.set_generate_debug_info();
        }
        options.add_macro_definition(entry, None);
        for (name, number) in self.given.iter().zip(FIRST_GIVEN..) {
            options.add_macro_definition(name, Some(&number.to_string()));
        }
        options.set_include_callback(|name, _, from, _| {
            let content = fs::read_to_string(self.folder.join(name))
                .map_err(|error| format!("glsl/{name}, included from {from}: {error}"))?;
            Ok(shaderc::ResolvedInclude { resolved_name: format!("glsl/{name}"), content })
        });
        // Messages name the file from the root of the project, with forward slashes.
        let inner = self.file.strip_prefix(self.folder).unwrap_or(self.file);
        let parts: Vec<_> = inner.iter().map(|part| part.to_string_lossy()).collect();
        let shown = format!("glsl/{}", parts.join("/"));
        match compiler.compile_into_spirv(&self.text, stage, &shown, "main", Some(&options)) {
            Ok(artifact) => artifact.as_binary().to_vec(),
            Err(error) => refuse!("{shown} ({entry}): {error}"),
        }
    }
}

/// Bindings (`false`) and specialisation constants (`true`) of `glsl/interface.glsl` by number: name there, and what it says.
type Numbers = BTreeMap<(bool, u32), (String, String)>;

/// The number of the first specialisation constant that takes the value of an option or a property of the device.
const FIRST_GIVEN: u32 = 64;

/// Returns the names of all these specialisation constants, in the order of their numbers.
fn given_constants(files: &[PathBuf]) -> Vec<String> {
    let mut names = BTreeSet::new();
    for file in files {
        let text = read(file);
        let declared = text.lines().filter_map(|line| line.strip_prefix("layout(constant_id = "));
        let declared = declared.filter_map(|rest| Some(rest.split_once(')')?.0.to_string()));
        names.extend(declared.filter(|name| name.starts_with("OPTION_") || name.starts_with("DEVICE_")));
    }
    names.into_iter().collect()
}

/// Writes a constant for each `#define NAME n`, under the same name. Returns the bindings and specialisation constants, which
/// Rust knows by the structures of inputs only.
fn constants(interface: &str, rust: &mut String) -> Numbers {
    let mut numbers = Numbers::new();
    for line in interface.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [define, name, number, ..] = words[..] else { continue };
        if define != "#define" {
            continue;
        }
        let Ok(value) = number.parse::<u32>() else {
            refuse!("glsl/interface.glsl: `{line}`: {name} must be a plain number")
        };
        let is_constant = name.starts_with("SPEC_");
        if is_constant || name.starts_with("BINDING_") {
            let says = line.split_once("// ").map_or_else(String::new, |(_, says)| says.to_string());
            if let Some((other, _)) = numbers.insert((is_constant, value), (name.to_string(), says)) {
                refuse!("glsl/interface.glsl: {name} and {other} have one number");
            }
            if is_constant && value >= FIRST_GIVEN {
                refuse!(
                    "glsl/interface.glsl: {name}: numbers from {FIRST_GIVEN} belong to options and the device"
                );
            }
            continue;
        }
        let _ = writeln!(
            rust,
            "/// `{name}` of `glsl/interface.glsl`.\npub(crate) const {name}: u32 = {number};"
        );
    }
    numbers
}

/// A header that declares resources or specialisation constants.
struct Header {
    /// Name of the file without its extension.
    stem: String,
    /// Names of the bindings and constants that it declares.
    declares: Vec<String>,
}

/// Collects the headers that a file includes, directly or through others.
fn collect_headers(folder: &Path, source: &str, headers: &mut Vec<Header>) {
    for line in source.lines() {
        let Some(name) = line.trim().strip_prefix("#include \"").and_then(|rest| rest.strip_suffix('"'))
        else {
            continue;
        };
        let stem = stem(Path::new(name));
        if headers.iter().any(|header| header.stem == stem) {
            continue;
        }
        let text = read(&folder.join(name));
        let declared = |line: &str| {
            let inner = line.strip_prefix("layout(")?.split_once(')')?.0;
            let name = inner
                .split([' ', ','])
                .find(|word| word.starts_with("BINDING_") || word.starts_with("SPEC_"));
            name.map(str::to_string)
        };
        headers.push(Header { stem, declares: text.lines().filter_map(declared).collect() });
        collect_headers(folder, &text, headers);
    }
}

/// A resource or a specialisation constant that an entry reads.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Field {
    /// Name in `glsl/interface.glsl`.
    name: String,
    says: String,
    /// Type in Rust.
    kind: &'static str,
    number: u32,
}

impl Field {
    /// The name of the Rust field.
    fn short(&self) -> String {
        self.name.trim_start_matches("BINDING_").trim_start_matches("SPEC_").to_lowercase()
    }

    fn declare(&self, rust: &mut String) {
        if !self.says.is_empty() {
            let _ = writeln!(rust, "    /// {}.", self.says);
        }
        let _ = writeln!(rust, "    pub(crate) {}: {},", self.short(), self.kind);
    }

    fn list(&self, rust: &mut String) {
        let (short, number) = (self.short(), self.number);
        let _ = match self.kind {
            "u32" => writeln!(rust, "        to.constants.push(({number}, self.{short}));"),
            "bool" => writeln!(rust, "        to.constants.push(({number}, u32::from(self.{short})));"),
            _ => writeln!(rust, "        to.resources.push(({number}, self.{short}.0.clone()));"),
        };
    }
}

/// The inputs of entries of one file that read the same.
struct EntryInputs {
    stem: String,
    /// Entries with these inputs, and the names and descriptions of their modules.
    modules: Vec<[String; 3]>,
    own: BTreeSet<Field>,
    /// Stems of the headers that declare further inputs.
    headers: BTreeSet<String>,
}

impl EntryInputs {
    /// Returns the file's name and the words that the names of all entries share, or the name of the first entry.
    fn name(&self) -> String {
        let words = |entry: &str| entry.split('_').map(str::to_string).collect::<Vec<_>>();
        let first = words(&self.modules[0][0]);
        let mut shared = first.clone();
        shared.retain(|word| self.modules.iter().all(|[entry, ..]| words(entry).contains(word)));
        format!("{}-{}", self.stem, if shared.is_empty() { first.join("-") } else { shared.join("-") })
    }
}

/// The inputs of all entries and of the headers that they include.
#[derive(Default)]
struct AllInputs {
    entries: Vec<EntryInputs>,
    headers: BTreeMap<String, BTreeSet<Field>>,
}

impl AllInputs {
    /// Adds a module, given by its entry, name and description, of the file `stem`.
    fn add(&mut self, stem: &str, module: [String; 3], fields: Vec<Field>, headers: &[Header]) {
        let (mut own, mut including) = (BTreeSet::new(), BTreeSet::new());
        for field in fields {
            match headers.iter().find(|header| header.declares.contains(&field.name)) {
                Some(header) => {
                    including.insert(header.stem.clone());
                    self.headers.entry(header.stem.clone()).or_default().insert(field);
                }
                None => drop(own.insert(field)),
            }
        }
        let same = |other: &EntryInputs| other.stem == stem && other.own == own && other.headers == including;
        let at = self.entries.iter().position(same).unwrap_or(self.entries.len());
        if at == self.entries.len() {
            let (stem, headers) = (stem.to_string(), including);
            self.entries.push(EntryInputs { stem, modules: Vec::new(), own, headers });
        }
        self.entries[at].modules.push(module);
    }

    /// Writes the structures, and for each module its entry.
    fn write(&self, rust: &mut String) {
        for (stem, fields) in self.headers.iter().filter(|(_, fields)| fields.len() > 1) {
            let of = format!("the header `{stem}.glsl`");
            structure(&camel(stem), &of, fields.iter(), &[], rust);
        }
        for inputs in &self.entries {
            let alone = self.entries.iter().filter(|other| other.stem == inputs.stem).count() == 1;
            let name = camel(&if alone { inputs.stem.clone() } else { inputs.name() });
            let (single, several): (Vec<&String>, Vec<&String>) =
                inputs.headers.iter().partition(|stem| self.headers[*stem].len() == 1);
            let fields = inputs.own.iter().chain(single.into_iter().flat_map(|stem| &self.headers[stem]));
            let modules: Vec<String> =
                inputs.modules.iter().map(|[_, module, _]| format!("`{module}`")).collect();
            structure(&name, &modules.join(", "), fields, &several, rust);
            for [_, module, description] in &inputs.modules {
                let _ = writeln!(
                    rust,
                    "/// `{module}`, compiled from `glsl/`.\n\
                     pub(crate) const {module}: Entry<{name}> = Entry::new(&{description});"
                );
            }
        }
    }
}

/// Writes a structure of inputs: fields, and structures of headers.
fn structure<'a>(
    name: &str,
    of: &str,
    fields: impl Iterator<Item = &'a Field>,
    headers: &[&String],
    rust: &mut String,
) {
    let mut list = String::new();
    let _ = writeln!(rust, "/// Inputs of {of}.\n#[derive(Clone, Debug)]\npub(crate) struct {name} {{");
    for field in fields {
        field.declare(rust);
        field.list(&mut list);
    }
    for header in headers {
        let short = header.replace('-', "_");
        let _ = writeln!(
            rust,
            "    /// Inputs of the header `{header}.glsl`.\n    pub(crate) {short}: {},",
            camel(header)
        );
        let _ = writeln!(list, "        self.{short}.list(to);");
    }
    let _ = writeln!(
        rust,
        "}}\nimpl Inputs for {name} {{\n    fn list(&self, {}: &mut Bound) {{\n{list}    }}\n}}\n",
        if list.is_empty() { "_" } else { "to" }
    );
}

/// Converts `words-of_A-name` to `WordsOfAName`.
fn camel(name: &str) -> String {
    let words = name.split(['-', '_']).map(|word| {
        let (first, rest) = word.split_at(word.len().min(1));
        first.to_uppercase() + &rest.to_lowercase()
    });
    words.collect()
}

/// The layout of a structure in the shaders: (name, offset) of its members, then its size.
type Layout = (Vec<(String, u32)>, u32);

fn assertions(layouts: &BTreeMap<String, Layout>, rust: &mut String) {
    for (name, (members, size)) in layouts {
        let _ = writeln!(rust, "const _: () = {{");
        for (member, offset) in members {
            let _ = writeln!(
                rust,
                "    assert!(std::mem::offset_of!(crate::interface::{name}, {member}) == {offset}, \
                 \"host and GLSL disagree on {name}.{member}\");"
            );
        }
        let _ = writeln!(
            rust,
            "    assert!(size_of::<crate::interface::{name}>() == {size}, \"host and GLSL disagree on the size of {name}\");\n}};"
        );
    }
}

/// The parts of a SPIR-V module that this build reads.
#[derive(Default)]
struct Module {
    names: BTreeMap<u32, String>,
    member_names: BTreeMap<(u32, u32), String>,
    offsets: BTreeMap<(u32, u32), u32>,
    strides: BTreeMap<u32, u32>,
    bindings: BTreeMap<u32, u32>,
    /// Variables, and types of blocks with a member, that shaders only read.
    read_only: BTreeSet<u32>,
    /// Numbers of specialisation constants, and which of these are booleans.
    specialised: BTreeMap<u32, u32>,
    booleans: BTreeSet<u32>,
    /// The entry point, and the operands of each function's instructions.
    entry: u32,
    functions: BTreeMap<u32, BTreeSet<u32>>,
    /// Operands of specialisation constants that are computed from others.
    computed: BTreeMap<u32, Vec<u32>>,
    types: BTreeMap<u32, Vec<u32>>,
    variables: Vec<(u32, u32, u32)>,
    constants: BTreeMap<u32, u32>,
}

impl Module {
    /// Reads names, decorations, types and variables (SPIR-V specification, section 3.42).
    fn parse(words: &[u32]) -> Self {
        let mut module = Self::default();
        let (mut at, mut function) = (5, None);
        while at < words.len() {
            let (length, op) = ((words[at] >> 16) as usize, words[at] & 0xffff);
            let Some(operands) = words.get(at + 1..at + length.max(1)) else { break };
            match (op, operands) {
                (5, [id, rest @ ..]) => drop(module.names.insert(*id, text(rest))),
                (6, [id, member, rest @ ..]) => drop(module.member_names.insert((*id, *member), text(rest))),
                (71, [id, 1, number]) => drop(module.specialised.insert(*id, *number)),
                (71, [id, 24]) | (72, [id, _, 24]) => drop(module.read_only.insert(*id)),
                (48 | 49, [_, id]) => drop(module.booleans.insert(*id)),
                (71, [id, 33, binding]) => drop(module.bindings.insert(*id, *binding)),
                (71, [id, 6, stride]) => drop(module.strides.insert(*id, *stride)),
                (72, [id, member, 35, offset]) => drop(module.offsets.insert((*id, *member), *offset)),
                (43, [_, id, value, ..]) => drop(module.constants.insert(*id, *value)),
                (59, [kind, id, class, ..]) => module.variables.push((*kind, *id, *class)),
                (20..=32, [id, ..]) => {
                    let mut kind = operands.to_vec();
                    kind[0] = op;
                    module.types.insert(*id, kind);
                }
                (15, [_, id, ..]) => module.entry = *id,
                (52, [_, id, rest @ ..]) => drop(module.computed.insert(*id, rest.to_vec())),
                (54, [_, id, ..]) => function = Some(*id),
                // A line of the source.
                (8, _) => {}
                _ => {
                    if let Some(id) = function {
                        module.functions.entry(id).or_default().extend(operands);
                    }
                }
            }
            at += length.max(1);
        }
        let used = module.used();
        module.variables.retain(|(_, id, class)| used.contains(id) || *class == 9);
        module.specialised.retain(|id, _| used.contains(id));
        module
    }

    /// Returns the operands of all functions that the entry point calls: the compiler also keeps functions, variables and
    /// constants that it does not use.
    fn used(&self) -> BTreeSet<u32> {
        let (mut used, mut next) = (BTreeSet::new(), vec![self.entry]);
        while let Some(id) = next.pop() {
            if !used.insert(id) {
                continue;
            }
            next.extend(self.functions.get(&id).into_iter().flatten());
            next.extend(self.computed.get(&id).into_iter().flatten());
        }
        used
    }

    /// Returns the operation that declares a type, and its operands; nothing for other identifiers.
    fn kind(&self, id: u32) -> &[u32] {
        self.types.get(&id).map_or(&[], Vec::as_slice)
    }

    /// Returns the type that a pointer variable points at.
    fn pointee(&self, pointer: u32) -> u32 {
        match self.kind(pointer) {
            [32, _, target] => *target,
            _ => 0,
        }
    }

    /// Collects the structures with offsets in the push constants and buffers of the module. A block whose members are
    /// all structures or arrays of them is only a wrapper around them.
    fn layouts(&self, file: &Path, layouts: &mut BTreeMap<String, Layout>) {
        // Uniform, push constant, storage buffer.
        for &(pointer, ..) in self.variables.iter().filter(|(.., class)| [2, 9, 12].contains(class)) {
            let block = self.pointee(pointer);
            let [30, members @ ..] = self.kind(block) else { continue };
            let elements: Option<Vec<u32>> = members.iter().map(|member| self.framed(*member)).collect();
            for id in elements.unwrap_or(vec![block]) {
                let Some((name, layout)) = self.layout(id) else { continue };
                if layouts.get(&name).is_some_and(|other| *other != layout) {
                    refuse!("{}: {name} is laid out differently here than in another shader", file.display());
                }
                layouts.insert(name, layout);
            }
        }
    }

    /// Returns the structure itself, or the element of an array.
    fn framed(&self, id: u32) -> Option<u32> {
        if let [30, ..] = self.kind(id) { Some(id) } else { self.array_element(id) }
    }

    fn array_element(&self, id: u32) -> Option<u32> {
        match self.kind(id) {
            [28 | 29, element, ..] => Some(*element),
            _ => None,
        }
    }

    /// Returns name and layout of a structure.
    fn layout(&self, id: u32) -> Option<(String, Layout)> {
        let [30, members @ ..] = self.kind(id) else { return None };
        let mut fields = Vec::new();
        let mut size = 0;
        for (i, member) in (0..).zip(members) {
            let offset = self.offsets.get(&(id, i)).copied().unwrap_or(0);
            size = size.max(offset + self.size(*member));
            fields.push((self.member_names.get(&(id, i)).cloned().unwrap_or_default(), offset));
        }
        let mut arrays = self.types.keys().filter(|array| self.array_element(**array) == Some(id));
        let stride = arrays.find_map(|array| self.strides.get(array).copied());
        Some((self.names.get(&id).cloned().unwrap_or_default(), (fields, stride.unwrap_or(size))))
    }

    /// Returns the size in bytes of a type that a shared structure may have.
    fn size(&self, id: u32) -> u32 {
        match self.kind(id) {
            [21 | 22, bits, ..] => bits / 8,
            [23, element, count] => self.size(*element) * count,
            [28, _, count] => {
                self.strides.get(&id).copied().unwrap_or(0) * self.constants.get(count).copied().unwrap_or(0)
            }
            _ => 0,
        }
    }

    /// Returns the resources by binding: descriptor type, and type of the input in Rust.
    fn resources(&self, name: &str) -> BTreeMap<u32, (&'static str, &'static str)> {
        let mut resources = BTreeMap::new();
        for &(pointer, id, class) in &self.variables {
            let Some(&binding) = self.bindings.get(&id) else { continue };
            let mut target = self.pointee(pointer);
            while let Some(element) = self.array_element(target) {
                target = element;
            }
            let read_only = self.read_only.contains(&id) || self.read_only.contains(&target);
            let kinds = match (class, self.kind(target)) {
                (12, _) => ("STORAGE_BUFFER", if read_only { "Read" } else { "Write" }),
                (2, _) => ("UNIFORM_BUFFER", "Uniform"),
                (_, [27, ..]) => ("COMBINED_IMAGE_SAMPLER", "Sampled"),
                (_, [25, ..]) => ("STORAGE_IMAGE", "Stored"),
                _ => refuse!("{name}: binding {binding} is of a kind that this build does not know"),
            };
            resources.insert(binding, kinds);
        }
        resources
    }

    /// Returns the inputs of the module, named as in `glsl/interface.glsl`.
    fn fields(&self, name: &str, numbers: &Numbers) -> Vec<Field> {
        let field = |is_constant: bool, number: u32, kind: &'static str| {
            let Some((name, says)) = numbers.get(&(is_constant, number)) else {
                refuse!("{name}: number {number} of an input has no name in glsl/interface.glsl")
            };
            Field { name: name.clone(), says: says.clone(), kind, number }
        };
        let resources = self.resources(name).into_iter();
        let resources = resources.map(|(binding, (_, kind))| field(false, binding, kind));
        let constants = self.specialised.iter().filter(|(_, number)| **number < FIRST_GIVEN);
        let constants = constants.map(|(id, &number)| {
            field(true, number, if self.booleans.contains(id) { "bool" } else { "u32" })
        });
        resources.chain(constants).collect()
    }

    /// Describes the module as a `Shader`: code, stage, size of the push constants, bindings, constants that take options and
    /// properties of the device.
    fn describe(&self, name: &str, stage: shaderc::ShaderKind, given: &[String]) -> String {
        let mut pushes = self.variables.iter().filter(|(.., class)| *class == 9);
        let push = pushes.find_map(|(pointer, ..)| self.layout(self.pointee(*pointer)));
        let push_bytes = push.map_or(0, |(_, (_, size))| size);
        let stage = format!("{stage:?}").to_uppercase();
        let resources = self.resources(name).into_iter();
        let bindings: Vec<String> = resources
            .map(|(binding, (kind, _))| format!("({binding}, vk::DescriptorType::{kind})"))
            .collect();
        let read = given.iter().zip(FIRST_GIVEN..);
        let read = read.filter(|(_, number)| self.specialised.values().any(|other| other == number));
        let (mut options, mut device) = (Vec::new(), Vec::new());
        for (name, number) in read {
            if let Some(key) = name.strip_prefix("OPTION_") {
                options.push(format!("(\"{}\", {number})", key.to_lowercase().replace('_', "-")));
            } else if let Some(property) = name.strip_prefix("DEVICE_") {
                device.push(format!("(DeviceConstant::{}, {number})", camel(property)));
            }
        }
        format!(
            "Shader {{ name: \"{name}\", stage: vk::ShaderStageFlags::{stage}, push_bytes: {push_bytes}, \
             bindings: &[{}], options: &[{}], device: &[{}], code: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{name}.spv\")) }}",
            bindings.join(", "),
            options.join(", "),
            device.join(", ")
        )
    }
}

/// Returns the module with all arithmetic on floats decorated as `NoContraction`: two variants of a pipeline round alike, because
/// the driver fuses no products and sums but those that the source fuses by `fma`.
fn rounded_as_written(words: &[u32]) -> Vec<u32> {
    const ARITHMETIC: [u32; 6] = [127, 129, 131, 133, 142, 148]; // negate, add, subtract, multiply, scale a vector, dot
    let (mut types, mut decorated, mut results, mut at) = (None, BTreeSet::new(), BTreeSet::new(), 5);
    while at < words.len() {
        let (length, op) = ((words[at] >> 16) as usize, words[at] & 0xffff);
        match op {
            19 => types = types.or(Some(at)),
            71 if words[at + 2] == 42 => drop(decorated.insert(words[at + 1])),
            op if ARITHMETIC.contains(&op) => drop(results.insert(words[at + 2])),
            _ => {}
        }
        at += length.max(1);
    }
    // Decorations stand before the first type.
    let (before, after) = words.split_at(types.unwrap_or(5));
    let decorations = results.difference(&decorated).flat_map(|&id| [3 << 16 | 71, id, 42]);
    before.iter().copied().chain(decorations).chain(after.iter().copied()).collect()
}

/// Refuses a module that takes SwiftShader's compiler more than a second. For each edge into a loop it searches breadth-first for a
/// path from the loop's head that closes the loop, and marks blocks when it leaves them: the queue doubles with each selection that
/// follows another. The module's functions are inlined.
fn refuse_slow_searches(name: &str, words: &[u32]) {
    const MOST_VISITS: u32 = 1 << 24;
    let (mut outs, mut ins) = (BTreeMap::<u32, Vec<u32>>::new(), BTreeMap::<u32, BTreeSet<u32>>::new());
    let (mut loops, mut at, mut block) = (Vec::new(), 5, 0);
    while at < words.len() {
        let (length, op) = ((words[at] >> 16) as usize, words[at] & 0xffff);
        let Some(operands) = words.get(at + 1..at + length.max(1)) else { break };
        let targets = match (op, operands) {
            (248, [label]) => {
                block = *label;
                Vec::new()
            }
            (246, [merge, ..]) => {
                loops.push((block, *merge));
                Vec::new()
            }
            (249, [target]) => vec![*target],
            (250, [_, yes, no, ..]) => vec![*yes, *no],
            (251, [_, default, cases @ ..]) => {
                cases.iter().skip(1).step_by(2).chain([default]).copied().collect()
            }
            _ => Vec::new(),
        };
        for target in targets {
            ins.entry(target).or_default().insert(block);
            outs.entry(block).or_default().push(target);
        }
        at += length.max(1);
    }
    let mut visits = 0;
    for (head, merge) in loops {
        for end in ins.get(&head).into_iter().flatten() {
            let mut left = BTreeSet::from([merge]);
            let mut queue = VecDeque::from([head]);
            'search: while let Some(block) = queue.pop_front() {
                visits += 1;
                if visits > MOST_VISITS {
                    refuse!(
                        "{name}: SwiftShader compiles this for more than a second: too many branches follow each other in a loop; use mix() and all()"
                    );
                }
                for out in outs.get(&block).into_iter().flatten().filter(|out| !left.contains(out)) {
                    if out == end {
                        break 'search;
                    }
                    queue.push_back(*out);
                }
                left.insert(block);
            }
        }
    }
}

/// Decodes a literal string of SPIR-V: four bytes per word, ended by zero.
fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> =
        words.iter().flat_map(|word| word.to_le_bytes()).take_while(|&byte| byte != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}
