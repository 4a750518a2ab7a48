//! The guide and the README are true: each command of the guide runs, in the order of its pages,
//! files that the program reads and writes keep to their schemas, and links lead somewhere.

mod schema;

use self::schema::faults;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Beams of each scanner of the demo: few, so that all commands take less than a minute.
const BEAMS: &str = "300000";
/// Longest picture of the README and the guide, bytes.
const MOST_BYTES: u64 = 300_000;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Targets of the links and pictures of a page.
fn links(page: &str) -> Vec<String> {
    let ends = |part: &str| part.split_once(')').map(|(link, _)| link.to_owned());
    page.split("](").skip(1).filter_map(ends).collect()
}

/// The pages of the guide, in the order of its list.
fn pages() -> Vec<PathBuf> {
    let guide = root().join("src/guide");
    let listed = links(&text(&guide.join("SUMMARY.md")));
    listed.into_iter().map(|name| guide.join(name)).collect()
}

/// A block of a page between fences: its language, its text, and the file that it is to be saved
/// as.
struct Block {
    language: String,
    text: String,
    file: Option<String>,
}

fn blocks(page: &str) -> Vec<Block> {
    let mut out: Vec<Block> = Vec::new();
    let (mut is_open, mut above) = (false, String::new());
    for line in page.lines() {
        match (line.strip_prefix("```"), is_open) {
            (Some(_), true) => (is_open, above) = (false, String::new()),
            (Some(language), false) => {
                // `Save this as `name`:` may be broken over two lines.
                let saved = above.rsplit_once("Save this as `");
                let file = saved
                    .and_then(|(_, rest)| Some(rest.trim_end().strip_suffix("`:")?.to_owned()));
                out.push(Block { language: language.into(), text: String::new(), file });
                is_open = true;
            }
            (None, true) => {
                let block = out.last_mut().expect("a block is open");
                block.text += &format!("{line}\n");
            }
            (None, false) => above += &format!("{line} "),
        }
    }
    // The line above a fence is empty: what is to be saved ends before it.
    out
}

/// Exit codes that a command may have: `# exits with 0, 1 or 3` stands behind it, or it is 0.
fn exit_codes(line: &str) -> (&str, Vec<i32>) {
    let Some((command, said)) = line.split_once(" # exits with ") else { return (line, vec![0]) };
    let codes = said.replace(" or ", ", ");
    (command, codes.split(", ").map(|code| code.parse().expect("a code")).collect())
}

/// Runs a command of the guide in a folder; `> FILE` at its end keeps its standard output.
fn run(line: &str, folder: &Path) {
    let (command, codes) = exit_codes(line);
    let (command, file) = command.split_once(" > ").map_or((command, None), |(c, f)| (c, Some(f)));
    let mut words: Vec<&str> = command.split_whitespace().collect();
    assert_eq!(words.remove(0), "stillpoint", "{line}");
    if words[0] == "demo" {
        words.extend(["--beams", BEAMS]);
    }
    let mut program = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
    let output = program.args(&words).current_dir(folder).output().expect("the program starts");
    let code = output.status.code().expect("a code, no signal");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(codes.contains(&code), "{line}: exit code {code}\n{said}");
    if let Some(file) = file {
        fs::write(folder.join(file), &output.stdout).expect("writes");
    }
}

#[test]
fn every_command_of_the_guide_runs_and_files_keep_to_their_schemas() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let mut n_commands = 0;
    for page in pages() {
        for block in blocks(&text(&page)) {
            if let Some(file) = block.file {
                fs::write(at.join(file), &block.text).expect("writes");
            }
            if block.language != "sh" {
                continue;
            }
            for line in block.text.lines().filter(|line| !line.is_empty()) {
                run(line, at);
                n_commands += 1;
            }
        }
    }
    assert!(n_commands > 35, "{n_commands} commands");
    keep_to_their_schemas(at);
}

/// The schemas are those that the program has written to `schemas`, as the guide says.
fn keep_to_their_schemas(at: &Path) {
    let mut files: Vec<(&str, PathBuf)> = [
        ("result", "demo/result/result.json"),
        ("result", "demo/result_2/result.json"),
        ("manifest", "demo/result/manifest.json"),
        ("changes", "demo/result_2/changes.json"),
        ("scanners", "demo/scans/scanners.toml"),
        ("scanners", "scanners.toml"),
        ("scene", "demo/scene.toml"),
        ("review", "review.toml"),
        ("config", "plant.toml"),
        ("shards", "shards.json"),
    ]
    .map(|(name, file)| (name, at.join(file)))
    .into();
    for model in fs::read_dir(at.join("demo/robots")).expect("a library") {
        let sheet = model.expect("an entry").path().join("robot.toml");
        files.extend(sheet.is_file().then_some(("robot", sheet)));
    }
    let printed = Command::new(env!("CARGO_BIN_EXE_stillpoint")).args(["config", "print"]).output();
    let all = at.join("all.toml");
    fs::write(&all, printed.expect("the program starts").stdout).expect("writes");
    files.push(("config", all));
    assert!(files.iter().any(|(name, _)| *name == "robot"), "no model has a robot.toml");
    for (name, path) in files {
        let schema = text(&at.join(format!("schemas/{name}.schema.json")));
        let schema: Value = serde_json::from_str(&schema).expect("JSON");
        let found = faults(&schema, &value(&path));
        assert!(found.is_empty(), "{}:\n{}", path.display(), found.join("\n"));
    }
}

fn value(path: &Path) -> Value {
    let text = text(path);
    if path.extension().is_some_and(|end| end == "json") {
        return serde_json::from_str(&text).expect("JSON");
    }
    let table: toml::Table = text.parse().expect("TOML");
    serde_json::to_value(table).expect("TOML is JSON")
}

/// Number of folders between a page and the top of the book.
fn depth(page: &Path, book: &Path) -> usize {
    page.strip_prefix(book).map_or(0, |inside| inside.components().count() - 1)
}

/// Whether a link from a page so many folders deep stays in the book.
fn stays_in_the_book(depth: usize, link: &str) -> bool {
    let mut at = depth as i64;
    Path::new(link).components().all(|part| {
        match part {
            std::path::Component::ParentDir => at -= 1,
            std::path::Component::Normal(_) => at += 1,
            std::path::Component::CurDir => {}
            _ => return false,
        }
        at >= 0
    })
}

#[test]
fn links_lead_to_files_and_pictures_are_small() {
    let guide = root().join("src/guide");
    let all = [root().join("README.md"), guide.join("SUMMARY.md")].into_iter().chain(pages());
    let mut wrong = Vec::new();
    for page in all {
        let folder = page.parent().expect("a folder");
        for link in links(&text(&page)) {
            if link.starts_with("https://") {
                continue;
            }
            let (file, part) = link.split_once('#').unwrap_or((&link, ""));
            let to = folder.join(file);
            let small =
                !file.ends_with(".png") || to.metadata().is_ok_and(|m| m.len() < MOST_BYTES);
            let headings = || {
                let page = text(&to);
                let words = |line: &str| line.trim_start_matches('#').trim().to_lowercase();
                page.lines()
                    .filter(|l| l.starts_with('#'))
                    .any(|l| words(l).replace(' ', "-") == part)
            };
            // The book is read without the sources: what is not in its folder is not there.
            let leaves = page.starts_with(&guide) && !stays_in_the_book(depth(&page, &guide), file);
            if leaves || !to.exists() || !small || !part.is_empty() && !headings() {
                wrong.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}\n", wrong.join("\n"));
    // Each page of the folder is in the list, or nobody finds it.
    let mut names: Vec<PathBuf> = fs::read_dir(&guide)
        .expect("the guide")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|end| end == "md"))
        .collect();
    names.retain(|path| !path.ends_with("SUMMARY.md"));
    names.sort();
    let mut listed = pages();
    listed.sort();
    assert_eq!(names, listed);
}
