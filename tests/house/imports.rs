//! Who imports whom: rooms of `src/` import only rooms below them, and no files of one crate import
//! each other in a circle.

use super::{code, entries, report, root, rust_files};
use std::collections::{BTreeMap, BTreeSet};

/// Rooms of `src/`, and the plan, from the bottom up: each imports only those before it.
const ORDER: [&str; 17] = [
    "engine",
    "io",
    "job",
    "store",
    "cache",
    "positions",
    "detect",
    "label",
    "result",
    "estimate",
    "rescan",
    "check",
    "arrays",
    "plan",
    "shards",
    "eval",
    "cli",
];
/// Files that may stand beside the rooms; `build.rs` runs before any of them is compiled.
const BESIDE: [&str; 4] = ["build.rs", "lib.rs", "main.rs", "plan.rs"];
/// The room of benches and demo, and the one room that may import it.
const EDGE: [&str; 2] = ["eval", "cli"];
/// Stages of which no files import each other in a circle; one that is freed joins the list.
const FREE: [&str; 24] = [
    "attach",
    "base_search",
    "baseline",
    "change",
    "clearance",
    "cluster",
    "contract",
    "export",
    "fit",
    "floor",
    "frame",
    "freespace",
    "geometry",
    "give_back",
    "ingest",
    "lattice",
    "py",
    "register",
    "report_page",
    "robot",
    "scene",
    "segment",
    "simulate",
    "surface",
];

/// A path of modules from the root of its crate on.
type Path = Vec<String>;

/// A `use` of something of the same crate.
struct Use {
    path: Path,
    /// The name that it has here.
    name: String,
}

/// A file of a crate.
struct Module {
    file: String,
    code: String,
    uses: Vec<Use>,
}

/// All files of a crate, by module.
struct Crate(BTreeMap<Path, Module>);

impl Crate {
    /// Reads the files below a folder.
    fn read(folder: &str) -> Self {
        let mut modules = BTreeMap::new();
        for (file, text) in rust_files(folder) {
            let inner = file.strip_prefix(folder).expect("below the folder");
            let inner = inner.trim_start_matches('/').trim_end_matches(".rs");
            let mut path: Path = inner.split('/').map(String::from).collect();
            if path.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
                path.pop();
            }
            let code = code(&file, &text);
            let is_program = file.ends_with("/main.rs") || file.ends_with("/build.rs");
            if !is_program && !code.is_empty() {
                modules.insert(path, Module { file, code, uses: Vec::new() });
            }
        }
        let mut all = Self(modules);
        let paths: Vec<Path> = all.0.keys().cloned().collect();
        for path in paths {
            let uses = all.uses_of(&path);
            all.0.get_mut(&path).expect("a module").uses = uses;
        }
        all
    }

    /// The uses of a module that are of the same crate.
    fn uses_of(&self, module: &Path) -> Vec<Use> {
        let mut out = Vec::new();
        for tree in use_statements(&self.0[module].code) {
            let mut leaves = Vec::new();
            expand(&tree, &[], &mut leaves);
            for (path, name) in leaves {
                out.extend(self.absolute(module, &path).map(|path| Use { path, name }));
            }
        }
        out
    }

    /// A path as it is written in a module, from the root of the crate on; none of another crate.
    fn absolute(&self, module: &Path, written: &[String]) -> Option<Path> {
        let mut base = module.clone();
        let mut rest = written;
        match rest.first()?.as_str() {
            "crate" => {
                base.clear();
                rest = &rest[1..];
            }
            "self" => rest = &rest[1..],
            "super" => {
                while rest.first().is_some_and(|part| part == "super") {
                    base.pop();
                    rest = &rest[1..];
                }
            }
            child => {
                let path: Path = base.iter().cloned().chain([child.to_owned()]).collect();
                if !self.0.contains_key(&path) {
                    return None;
                }
            }
        }
        Some(base.into_iter().chain(rest.iter().cloned()).collect())
    }

    /// The module that what a path names is written in; none where it names a module itself.
    /// Uses that hand a name on are followed.
    fn owner(&self, path: &Path, depth: usize) -> Option<Path> {
        let mut module = path.clone();
        while !self.0.contains_key(&module) {
            module.pop()?;
        }
        let name = path.get(module.len())?;
        let handed_on = self.0[&module].uses.iter().find(|u| u.name == *name && depth > 0);
        match handed_on {
            Some(u) => {
                let rest = path[module.len() + 1..].iter().cloned();
                let path: Path = u.path.iter().cloned().chain(rest).collect();
                self.owner(&path, depth - 1)
            }
            None => Some(module),
        }
    }

    /// The modules that each module takes something from.
    fn imports(&self) -> BTreeMap<&Path, BTreeSet<Path>> {
        let mut out = BTreeMap::new();
        for (path, module) in &self.0 {
            let mut own: BTreeSet<Path> = BTreeSet::new();
            own.extend(module.uses.iter().filter_map(|u| self.owner(&u.path, 8)));
            for written in paths_in(&without_uses(&module.code)) {
                // A module that is imported by name stands for its path.
                let alias = module.uses.iter().find(|u| u.name == written[0]);
                let whole = match alias {
                    Some(u) => {
                        let rest = written[1..].iter().cloned();
                        Some(u.path.iter().cloned().chain(rest).collect())
                    }
                    None => self.absolute(path, &written),
                };
                own.extend(whole.and_then(|whole: Path| self.owner(&whole, 8)));
            }
            own.remove(path);
            out.insert(path, own);
        }
        out
    }

    /// Files that import each other in a circle, in words: a line a circle.
    fn circles(&self) -> Vec<String> {
        let imports = self.imports();
        let reached = |from: &Path| {
            let mut seen: BTreeSet<&Path> = BTreeSet::new();
            let mut next: Vec<&Path> = imports[from].iter().collect();
            while let Some(at) = next.pop() {
                if seen.insert(at) {
                    next.extend(imports.get(at).into_iter().flatten());
                }
            }
            seen
        };
        let reached: BTreeMap<&Path, BTreeSet<&Path>> =
            self.0.keys().map(|path| (path, reached(path))).collect();
        let mut told = BTreeSet::new();
        for (path, own) in &reached {
            let circle: Vec<&str> = (own.iter())
                .filter(|other| reached[*other].contains(path) && own.contains(path))
                .map(|other| self.0[*other].file.as_str())
                .collect();
            if !circle.is_empty() {
                told.insert(format!("files in a circle: {}", circle.join(", ")));
            }
        }
        told.into_iter().collect()
    }
}

/// What stands between `use` and `;`, of all statements.
fn use_statements(code: &str) -> Vec<String> {
    let mut out = Vec::new();
    let mut open: Option<String> = None;
    for line in code.lines() {
        let line = line.trim();
        let begun = match &mut open {
            Some(text) => {
                text.push_str(line);
                true
            }
            None => use_in(line).map(|rest| open = Some(rest.to_owned())).is_some(),
        };
        if begun && line.ends_with(';') {
            out.extend(open.take().map(|text| text.trim_end_matches(';').to_owned()));
        }
    }
    out
}

/// What follows `use` in a line that begins with it, whoever may see it.
fn use_in(line: &str) -> Option<&str> {
    let rest = match line.strip_prefix("pub") {
        Some(rest) if rest.starts_with('(') => rest.split_once(')')?.1,
        Some(rest) => rest,
        None => line,
    };
    rest.trim_start().strip_prefix("use ")
}

/// The code without its `use` statements.
fn without_uses(code: &str) -> String {
    let mut is_in = false;
    let mut out = String::new();
    for line in code.lines() {
        is_in |= use_in(line.trim()).is_some();
        if !is_in {
            out.push_str(line);
            out.push('\n');
        }
        is_in &= !line.trim().ends_with(';');
    }
    out
}

/// The leaves of a tree of imports: each with its path, and the name that it gets.
fn expand(tree: &str, above: &[String], out: &mut Vec<(Path, String)>) {
    let mut depth = 0;
    let mut part = String::new();
    for c in tree.chars().chain([',']) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if c != ',' || depth > 0 {
            part.push(c);
            continue;
        }
        let whole = std::mem::take(&mut part);
        let whole = whole.trim();
        if let Some((head, inner)) = whole.split_once('{') {
            let head = head.split("::").map(str::trim).filter(|s| !s.is_empty());
            let path: Path = above.iter().cloned().chain(head.map(String::from)).collect();
            expand(inner.trim_end_matches('}'), &path, out);
        } else if !whole.is_empty() {
            let (path, alias) =
                whole.split_once(" as ").map_or((whole, None), |(p, a)| (p, Some(a)));
            let parts = path.split("::").map(|s| s.trim().to_owned());
            let mut path: Path = above.iter().cloned().chain(parts).collect();
            if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
                path.pop();
            }
            let name = alias.map(str::to_owned).or_else(|| path.last().cloned());
            out.push((path, name.unwrap_or_default()));
        }
    }
}

/// All paths of two parts or more that stand in code.
fn paths_in(code: &str) -> BTreeSet<Path> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let words = code.split(|c| !is_part(c)).filter(|word| word.contains("::"));
    let split = |word: &str| word.trim_end_matches(':').split("::").map(String::from).collect();
    words.map(split).filter(|path: &Path| path.len() > 1 && !path[0].is_empty()).collect()
}

fn room_of(path: &Path) -> Option<usize> {
    let first = path.first()?;
    ORDER.iter().position(|room| room == first)
}

#[test]
fn few_files_stand_beside_the_rooms() {
    let beside = entries(&root().join("src")).into_iter().filter(|path| path.is_file());
    let names = beside.map(|path| path.file_name().expect("a name").to_string_lossy().into_owned());
    let odd = names.filter(|name| name.ends_with(".rs") && !BESIDE.contains(&name.as_str()));
    report(&odd.map(|name| format!("src/{name} stands in no room")).collect::<Vec<_>>());
}

#[test]
fn rooms_import_only_rooms_below_them() {
    let all = Crate::read("src");
    let mut faults = Vec::new();
    for (path, imports) in all.imports() {
        let file = &all.0[path].file;
        let Some(room) = room_of(path) else {
            if !path.is_empty() {
                faults.push(format!("{file} stands in no room of the list in tests/house"));
            }
            continue;
        };
        for other in imports.iter().filter(|other| !other.is_empty()) {
            if room_of(other).is_none_or(|other| other > room) {
                faults.push(format!("{file} imports {}, which is above it", other.join("/")));
            }
            if other[0] == EDGE[0] && path[0] != EDGE[0] && path[0] != EDGE[1] {
                faults.push(format!("{file} imports benches: {}", other.join("/")));
            }
        }
    }
    report(&faults);
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let mut faults = Crate::read("src").circles();
    for stage in FREE {
        let folder = format!("stages/{stage}/src");
        if !root().join(&folder).is_dir() {
            faults.push(format!("there is no stage {stage}: take it off the list FREE"));
        }
        faults.extend(Crate::read(&folder).circles());
    }
    report(&faults);
}

/// Names of types that stand at the beginning of a line, or within a function.
fn types(code: &str) -> Vec<String> {
    let name = |line: &str| {
        let rest = match line.strip_prefix("pub") {
            Some(rest) if rest.starts_with('(') => rest.split_once(')')?.1,
            Some(rest) => rest,
            None => line,
        };
        let (kind, rest) = rest.trim_start().split_once(' ')?;
        let name = rest.split(|c: char| !c.is_alphanumeric()).next()?;
        ["struct", "enum", "trait", "type"].contains(&kind).then(|| name.to_owned())
    };
    // A type within an implementation belongs to its trait.
    let is_own = |line: &&str| !line.trim_start().starts_with("type ") || !line.starts_with(' ');
    code.lines().filter(is_own).filter_map(|line| name(line.trim_start())).collect()
}

#[test]
fn the_name_of_a_type_stands_once_in_src() {
    let mut owners: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (file, text) in rust_files("src") {
        for name in types(&code(&file, &text)) {
            owners.entry(name).or_default().push(file.clone());
        }
    }
    let twice = owners.iter().filter(|(_, files)| files.len() > 1);
    report(&twice.map(|(name, files)| format!("{name}: {}", files.join(", "))).collect::<Vec<_>>());
}

/// The reading of imports itself: names that are handed on lead to the file that has them, modules
/// that are imported by name stand for their paths.
#[test]
fn imports_lead_to_the_file_that_has_the_name() {
    let module =
        |file: &str, code: &str| Module { file: file.into(), code: code.into(), uses: Vec::new() };
    let path = |text: &str| text.split("::").filter(|s| !s.is_empty()).map(String::from).collect();
    let mut all = Crate(BTreeMap::from([
        (path("a"), module("a/mod.rs", "mod one;\nmod two;\npub use one::One;\n")),
        (path("a::one"), module("a/one.rs", "pub struct One;\nfn f() { super::two::g() }\n")),
        (path("a::two"), module("a/two.rs", "use super::{\n    One,\n};\npub fn g() {}\n")),
        (path("b"), module("b.rs", "use crate::a::{self, one};\nfn h() { one::f(a::two::X) }\n")),
    ]));
    let paths: Vec<Path> = all.0.keys().cloned().collect();
    for at in paths {
        let uses = all.uses_of(&at);
        all.0.get_mut(&at).expect("a module").uses = uses;
    }
    let imports = all.imports();
    assert_eq!(imports[&path("a")], BTreeSet::from([path("a::one")]));
    assert_eq!(imports[&path("b")], BTreeSet::from([path("a::one"), path("a::two")]));
    assert_eq!(all.circles(), ["files in a circle: a/one.rs, a/two.rs"]);
}
