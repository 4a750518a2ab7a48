//! What a person sees on a terminal: one bar for the whole run, nothing left of it afterwards,
//! colours where they are wanted, and errors with place and way out. `script`, which each Linux
//! system has, gives the program a terminal of its own.

use std::path::Path;
use std::process::Command;

/// Columns of the terminal: as narrow as a window mostly is at the beginning.
const COLUMNS: usize = 80;

/// All that the program writes to a terminal, and its exit code.
fn typed(command: &str, variables: &[(&str, &str)], folder: &Path) -> (String, i32) {
    let program = env!("CARGO_BIN_EXE_stillpoint");
    let line = format!("stty cols {COLUMNS} rows 24; exec '{program}' {command}");
    let output = Command::new("script")
        .args(["--quiet", "--return", "--command", &line, "/dev/null"])
        .env_remove("NO_COLOR")
        .env_remove("COLUMNS")
        .env("TERM", "xterm-256color")
        .envs(variables.iter().copied())
        .current_dir(folder)
        .stdin(std::process::Stdio::null())
        .output()
        .expect("`script` of util-linux");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    (text, output.status.code().expect("a code, no signal"))
}

/// Lines of a terminal after each write; only what the bar needs is known: return, next line, line
/// up, and wiping.
#[derive(Default)]
struct Screen {
    lines: Vec<String>,
    at: [usize; 2],
}

impl Screen {
    fn line(&mut self) -> &mut String {
        let row = self.at[0];
        self.lines.resize(self.lines.len().max(row + 1), String::new());
        &mut self.lines[row]
    }

    /// Takes a piece of the text and returns what is left of it. Colours are passed over.
    fn take<'a>(&mut self, text: &'a str) -> &'a str {
        if let Some(rest) = text.strip_prefix("\x1b[") {
            let end = rest.find(|c: char| c.is_ascii_alphabetic()).expect("a whole sequence");
            let n = rest[..end].parse().unwrap_or(1_usize);
            match &rest[end..=end] {
                "K" => self.line().clear(),
                "A" => self.at[0] = self.at[0].saturating_sub(n),
                "B" => self.at[0] += n,
                "m" | "h" | "l" => {}
                odd => panic!("this screen does not know the sequence {odd:?}"),
            }
            return &rest[end + 1..];
        }
        let c = text.chars().next().expect("not empty");
        match c {
            '\r' => self.at[1] = 0,
            '\n' => self.at[0] += 1,
            c => {
                let column = self.at[1];
                let mut line: Vec<char> = self.line().chars().collect();
                line.resize(line.len().max(column + 1), ' ');
                line[column] = c;
                *self.line() = line.into_iter().collect();
                self.at[1] += 1;
            }
        }
        &text[c.len_utf8()..]
    }
}

/// The lines at the end, and each different state of a bar on the way.
fn watched(text: &str) -> (Vec<String>, Vec<String>) {
    let (mut screen, mut bars, mut rest) = (Screen::default(), Vec::new(), text);
    while !rest.is_empty() {
        // A bar is whole before the cursor leaves its line or wipes it.
        if rest.starts_with(['\r', '\n', '\x1b']) {
            let now: Vec<&String> = screen.lines.iter().filter(|l| is_bar(l)).collect();
            assert!(now.len() <= 1, "two bars at once: {now:?}");
            if let Some(bar) = now.first().filter(|bar| bars.last() != Some(**bar)) {
                bars.push((*bar).clone());
            }
        }
        rest = screen.take(rest);
    }
    (screen.lines, bars)
}

fn is_bar(line: &str) -> bool {
    line.split_once(" [").is_some_and(|(_, rest)| rest.find(']') == Some(16))
}

/// Share of a bar that is full, sixteenths.
fn full(bar: &str) -> usize {
    bar.matches('=').count()
}

#[test]
fn a_run_has_one_bar_that_goes_on_to_the_end_and_leaves_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    crate::common::palletiser(folder.path(), 3, 400_000);
    let run = "run scans/scans.e57 --robots robots --out out";
    let (text, code) = typed(run, &[], folder.path());
    assert_eq!(code, 0, "{text}");
    let (lines, bars) = watched(&text);
    assert!(bars.len() > 3, "{bars:?}");
    for bar in &bars {
        assert!(bar.trim_end().chars().count() <= COLUMNS, "wider than the terminal: {bar:?}");
        // Nothing is known while the inputs are compared with those of an earlier run.
        let is_told = bar.contains(" to go") || bar.starts_with("comparing inputs");
        assert!(is_told, "no time to go: {bar:?}");
    }
    for stage in ["robot library", "finding robots"] {
        let of_stage = |bar: &&String| bar.starts_with(stage);
        assert!(bars.iter().any(|bar| of_stage(&bar)), "no {stage}: {bars:?}");
    }
    assert!(bars.is_sorted_by_key(|bar| full(bar)), "the bar goes back: {bars:?}");
    // Name and words belong to one stage: models are counted as items, and what is read as points.
    for bar in &bars {
        let is_of_points = bar.starts_with("reading scans") || bar.starts_with("labelling points");
        let words = bar.split_once(']').map_or("", |(_, words)| words);
        let other = if is_of_points { " item" } else { " points" };
        let is_of_items = bar.starts_with("robot library") || bar.starts_with("finding robots");
        assert!(
            !(is_of_points || is_of_items) || !words.contains(other),
            "of another stage: {bar:?}"
        );
    }
    assert!(!lines.iter().any(|line| is_bar(line)), "{lines:?}");
    let summary: Vec<&String> = lines.iter().filter(|line| !line.trim().is_empty()).collect();
    assert!(summary[0].starts_with("1 robot in"), "{summary:?}");
    assert!(summary.iter().any(|line| line.contains("out/report.html")), "{summary:?}");
}

#[test]
fn colours_are_those_that_were_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    crate::common::palletiser(folder.path(), 3, 40_000);
    let at = folder.path();
    let run = "run scans/scans.e57 --robots robots --out out";
    assert_eq!(typed(run, &[], at).1, 0);
    let is_coloured = |text: &str| text.contains("\x1b[3") || text.contains("\x1b[1;3");
    let report = "report out";
    for (command, variables, wanted) in [
        (report, &[][..], true),
        (report, &[("NO_COLOR", "1")][..], false),
        (report, &[("NO_COLOR", "")][..], true),
        ("report out --color never", &[][..], false),
        ("report out --color always", &[("NO_COLOR", "1")][..], true),
    ] {
        let (text, code) = typed(command, variables, at);
        assert_eq!(code, 0, "{text}");
        assert_eq!(is_coloured(&text), wanted, "{command} {variables:?}: {text}");
    }
}

#[test]
fn an_error_after_a_bar_stands_by_itself_with_place_and_way_out() {
    let folder = tempfile::tempdir().expect("a folder");
    crate::common::palletiser(folder.path(), 3, 40_000);
    let scans = folder.path().join("scans/scans.e57");
    let mut bytes = std::fs::read(&scans).expect("reads");
    let middle = bytes.len() / 2;
    bytes[middle..middle + 64].fill(0x5a);
    std::fs::write(&scans, bytes).expect("writes");
    let run = "run scans/scans.e57 --robots robots --out out";
    let (text, code) = typed(run, &[], folder.path());
    assert_eq!(code, 4, "{text}");
    let (lines, _) = watched(&text);
    assert!(!lines.iter().any(|line| is_bar(line)), "{lines:?}");
    let all = lines.join("\n");
    assert!(all.contains("error: ") && all.contains("scans/scans.e57"), "{all}");
    assert!(all.contains("--keep-going") || all.contains("again"), "no way out: {all}");
    assert!(text.contains("\x1b[31") || text.contains("\x1b[1;31"), "the error is red: {text:?}");
}
