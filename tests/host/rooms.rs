//! The tree is the architecture: imports go downwards from room to room, and no files import each other in a circle.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Rooms of `src/`, lower first. A room uses those before it.
const ROOMS: [&str; 22] = [
    "num",
    "error",
    "image",
    "replace",
    "interface",
    "scene",
    "optics",
    "io",
    "reference",
    "gpu",
    "primitives",
    "peak",
    "resident",
    "frame",
    "technique",
    "ranks",
    "measure",
    "choice",
    "ffi",
    "window",
    "lib",
    "cli",
];

/// Rooms of `glsl/`, each with those that its files may include from. All may include `interface.glsl`.
const SHADER_ROOMS: [(&str, &[&str]); 11] = [
    ("gpu", &["shared"]),
    ("peak", &["shared"]),
    ("resident", &["shared"]),
    ("shared", &[]),
    ("primitives", &["shared"]),
    ("frame", &["shared", "primitives"]),
    ("grid", &["shared", "primitives", "frame"]),
    ("shear-warp", &["shared", "primitives", "frame", "grid"]),
    ("mesh", &["shared", "primitives", "frame"]),
    ("splat", &["shared", "primitives", "frame"]),
    ("window", &[]),
];

type Names = Vec<String>;

/// A source file as a module.
#[derive(Default)]
struct Module {
    /// Paths that it imports or names, absolute.
    named: Vec<Names>,
    /// Names that it re-exports, with where they come from.
    doors: BTreeMap<String, Names>,
    /// Names that it defines.
    defines: BTreeSet<String>,
    /// Modules whose public names it re-exports all.
    open: Vec<Names>,
}

/// The files below a folder with an extension, relative to it.
fn files(root: &Path, extension: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == extension) {
                found.push(path.strip_prefix(root).unwrap().to_str().unwrap().to_string());
            }
        }
    }
    found.sort();
    found
}

/// A file's code without comments, strings and inline test modules.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let text = text.split("#[cfg(test)]\npub(crate) mod tests {").next().unwrap_or_default();
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    let joined = lines.collect::<Vec<_>>().join("\n");
    // Every second piece is a string.
    joined.replace("\\\"", "").replace("'\"'", "").split('"').step_by(2).collect::<Vec<_>>().join(" ")
}

fn module_of(file: &str) -> Names {
    let stem = file.trim_end_matches(".rs").trim_end_matches("/mod");
    if stem == "lib" { Vec::new() } else { stem.split('/').map(str::to_string).collect() }
}

/// The paths of a `use` tree, each with the name that it gets.
fn tree(text: &str) -> Vec<(Names, String)> {
    let text = text.trim();
    let Some((before, rest)) = text.split_once('{') else {
        let (path, alias) = text.split_once(" as ").unwrap_or((text, ""));
        let mut path: Names = path.split("::").map(|part| part.trim().to_string()).collect();
        if path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let name = if alias.is_empty() {
            path.last().cloned().unwrap_or_default()
        } else {
            alias.trim().to_string()
        };
        return vec![(path, name)];
    };
    let inside = rest.rsplit_once('}').unwrap().0;
    let (mut depth, mut items) = (0, vec![String::new()]);
    for letter in inside.chars() {
        depth += i32::from(letter == '{') - i32::from(letter == '}');
        if letter == ',' && depth == 0 {
            items.push(String::new())
        } else {
            items.last_mut().unwrap().push(letter)
        }
    }
    let prefix: Names =
        before.split("::").map(str::trim).filter(|p| !p.is_empty()).map(str::to_string).collect();
    let items = items.iter().filter(|item| !item.trim().is_empty());
    items.flat_map(|item| tree(item)).map(|(path, name)| ([prefix.clone(), path].concat(), name)).collect()
}

/// A path as seen from the crate's root; `None` for other crates.
fn absolute(path: &[String], from: &[String], modules: &BTreeMap<Names, Module>) -> Option<Names> {
    let child = |name: &String| modules.contains_key(&[from, std::slice::from_ref(name)].concat());
    let mut at = from.to_vec();
    let mut rest = path;
    match path.first()?.as_str() {
        "crate" | "volraster" => return Some(path[1..].to_vec()),
        "self" => rest = &path[1..],
        "super" => {
            while rest.first().is_some_and(|part| part == "super") {
                at.pop();
                rest = &rest[1..];
            }
        }
        _ if child(&path[0]) => {}
        _ => return None,
    }
    Some([at.as_slice(), rest].concat())
}

/// The paths in a file's code outside of `use`: those that begin at the root, above, or at a child.
fn inline_paths(code: &str) -> Vec<Names> {
    let is_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let words = code.split(|c: char| !is_path(c)).filter(|word| word.contains("::"));
    words
        .map(|word| word.split("::").filter(|part| !part.is_empty()).map(str::to_string).collect::<Names>())
        // `super` alone begins a group of names in a module inside of the file.
        .filter(|path| path.len() > 1)
        .collect()
}

/// Every module of the crate with what it names.
fn modules(root: &Path) -> BTreeMap<Names, Module> {
    let files = files(root, "rs");
    let mut modules: BTreeMap<Names, Module> =
        files.iter().map(|file| (module_of(file), Module::default())).collect();
    for file in &files {
        let from = module_of(file);
        let code = code(&std::fs::read_to_string(root.join(file)).unwrap());
        let mut module = Module::default();
        let mut plain = String::new();
        for statement in code.split(';') {
            let start = statement.rfind('\n').map_or(0, |_| statement.len() - statement.trim_start().len());
            let text = statement[start..].trim();
            let at = text
                .find("use ")
                .filter(|&at| at == 0 || text[..at].trim_end().ends_with(['}', ')', ']', 'b']));
            let Some(at) = at else {
                plain.push_str(statement);
                plain.push(';');
                continue;
            };
            plain.push_str(&text[..at]);
            let nested =
                statement.lines().any(|line| line.starts_with(' ') && line.trim_start().starts_with("use "));
            let public =
                text[..at].trim_end().ends_with("pub") || text[..at].trim_end().ends_with("pub(crate)");
            for (path, name) in tree(&text[at + 4..]) {
                // In a module inside of the file, `super` is the file.
                let path = if nested && path[0] == "super" { path[1..].to_vec() } else { path };
                let Some(path) = absolute(&path, &from, &modules) else { continue };
                let of_child = path.len() > from.len() && path.starts_with(&from);
                if public && name == "*" {
                    module.open.push(path[..path.len() - 1].to_vec());
                } else if public {
                    module.doors.insert(name, path.clone());
                }
                // A door is no import.
                if !(public && of_child) {
                    module.named.push(path);
                }
            }
        }
        module.named.extend(inline_paths(&plain).iter().filter_map(|path| absolute(path, &from, &modules)));
        let words: Vec<&str> =
            plain.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| !w.is_empty()).collect();
        let kinds = ["fn", "struct", "enum", "trait", "const", "static", "type"];
        module.defines =
            words.windows(2).filter(|w| kinds.contains(&w[0])).map(|w| w[1].to_string()).collect();
        modules.insert(from, module);
    }
    modules
}

/// The module that defines what a path names, through doors.
fn definer(path: &[String], modules: &BTreeMap<Names, Module>, depth: u32) -> Names {
    let mut at = 0;
    while at < path.len() && modules.contains_key(&path[..=at]) {
        at += 1;
    }
    let (module, rest) = path.split_at(at);
    if let (Some(name), true) = (rest.first(), depth < 8) {
        let door = &modules[module];
        if let Some(target) = door.doors.get(name) {
            return definer(&[target.as_slice(), &rest[1..]].concat(), modules, depth + 1);
        }
        for open in &door.open {
            let inside = definer(&[open.as_slice(), rest].concat(), modules, depth + 1);
            if modules[&inside].defines.contains(name) {
                return inside;
            }
        }
    }
    module.to_vec()
}

/// Which modules each module imports from.
fn imports(root: &Path) -> BTreeMap<String, BTreeSet<String>> {
    let modules = modules(root);
    let mut edges: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (from, module) in &modules {
        if from.iter().any(|part| part == "tests") {
            continue;
        }
        let targets = module.named.iter().map(|path| definer(path, &modules, 0));
        let targets = targets.filter(|target| target != from && !target.is_empty());
        edges.insert(from.join("/"), targets.map(|target| target.join("/")).collect());
    }
    edges
}

/// Edges from a lower room to a higher one.
fn upward(edges: &BTreeMap<String, BTreeSet<String>>, rooms: &[&str]) -> Vec<String> {
    let floor = |file: &str| {
        let room = file.split('/').next().unwrap().trim_end_matches(".glsl");
        let room = if room.is_empty() || room == "main" { "cli" } else { room };
        rooms.iter().position(|r| *r == room).unwrap_or_else(|| panic!("{file}: no room is called {room}"))
    };
    let pairs = edges.iter().flat_map(|(from, targets)| targets.iter().map(move |target| (from, target)));
    let wrong = pairs.filter(|(from, target)| !from.is_empty() && floor(target) > floor(from));
    wrong.map(|(from, target)| format!("{from} imports from {target}")).collect()
}

/// Files that import themselves, through others.
fn circles(edges: &BTreeMap<String, BTreeSet<String>>) -> BTreeSet<String> {
    let in_circle = |file: &&String| {
        let mut reached: BTreeSet<&String> = BTreeSet::new();
        let mut next = vec![*file];
        while let Some(at) = next.pop() {
            next.extend(
                edges[at].iter().filter(|target| edges.contains_key(*target) && reached.insert(target)),
            );
        }
        reached.contains(file)
    };
    edges.keys().filter(in_circle).cloned().collect()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn shader_includes() -> BTreeMap<String, BTreeSet<String>> {
    let glsl = root().join("glsl");
    let files = files(&glsl, "glsl");
    let included = |file: &String| {
        let text = std::fs::read_to_string(glsl.join(file)).unwrap();
        let lines = text.lines().filter_map(|line| line.strip_prefix("#include \""));
        lines.map(|line| line.trim_end_matches('"').to_string()).collect::<BTreeSet<_>>()
    };
    files.iter().map(|file| (file.clone(), included(file))).collect()
}

#[test]
fn imports_go_downwards() {
    let edges = imports(&root().join("src"));
    assert!(edges.values().map(BTreeSet::len).sum::<usize>() > 500, "the imports are found");
    let wrong = upward(&edges, &ROOMS);
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn no_files_import_each_other() {
    let circles = circles(&imports(&root().join("src")));
    assert!(circles.is_empty(), "{circles:#?}");
}

#[test]
fn includes_go_downwards() {
    let edges = shader_includes();
    for (file, included) in &edges {
        assert!(included.iter().all(|other| edges.contains_key(other)), "{file} includes {included:?}");
    }
    assert!(edges.values().map(BTreeSet::len).sum::<usize>() > 50, "the includes are found");
    let room = |file: &str| file.split_once('/').map(|(room, _)| room.to_string());
    let may = |from: &str, to: &str| match (room(from), room(to)) {
        (Some(from), Some(to)) => {
            from == to
                || SHADER_ROOMS.iter().any(|(room, below)| *room == from && below.contains(&to.as_str()))
        }
        _ => to == "interface.glsl",
    };
    let pairs = edges.iter().flat_map(|(from, targets)| targets.iter().map(move |target| (from, target)));
    let wrong: Vec<_> = pairs.filter(|(from, to)| !may(from, to)).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(circles(&edges).is_empty());
}

/// The checks above can fail.
#[test]
fn upward_imports_and_circles_are_seen() {
    let of = |pairs: &[(&str, &str)]| {
        let mut edges: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (from, target) in pairs {
            edges.entry((*from).to_string()).or_default().insert((*target).to_string());
            edges.entry((*target).to_string()).or_default();
        }
        edges
    };
    assert_eq!(upward(&of(&[("io/a", "gpu/b"), ("gpu/b", "io/c")]), &ROOMS), ["io/a imports from gpu/b"]);
    let found = circles(&of(&[("io/a", "io/b"), ("io/b", "io/c"), ("io/c", "io/b"), ("io/c", "io/d")]));
    assert_eq!(found.into_iter().collect::<Vec<_>>(), ["io/b", "io/c"]);
    // A path through a door leads to the file behind it.
    let edges = imports(&root().join("src"));
    assert!(edges["technique/renderer"].contains("resident/gpu_scene"), "{:?}", edges["technique/renderer"]);
}
