//! What progress shows of stages, and what it keeps of them.

use super::*;

#[derive(Clone, Default)]
struct Page(Arc<Mutex<Vec<u8>>>);

impl Write for Page {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().expect("not poisoned").extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn told(mode: Mode) -> (String, Vec<StageReport>) {
    let page = Page::default();
    let progress = Progress::to(mode, Box::new(page.clone()));
    let stage = progress.stage("read", Amount::points(2000));
    for _ in 0..1000 {
        stage.add(1, 2, 24);
    }
    drop(stage);
    let bytes = page.0.lock().expect("not poisoned").clone();
    (String::from_utf8(bytes).expect("text"), progress.reports())
}

#[test]
fn a_short_stage_is_one_line_and_one_report() {
    let (text, reports) = told(Mode::Plain);
    assert_eq!(text.lines().count(), 1, "{text}");
    assert!(text.starts_with("reading scans: 100 %, 2.00 k points"), "{text}");
    assert_eq!((reports[0].n_items, reports[0].n_points, reports[0].bytes), (1000, 2000, 24000));
    assert_eq!(told(Mode::None).0, "");
    assert_eq!(told(Mode::None).1.len(), 1);
}

#[test]
fn pieces_of_an_item_are_told_while_none_of_the_items_is_done() {
    let page = Page::default();
    let progress = Progress::to(Mode::Json, Box::new(page.clone()));
    let pieces = Pieces::default();
    let stage = progress.stage_of("fit", Amount::items(3), pieces.clone());
    // As if a second had gone by.
    stage.0.next_line.store(0, Ordering::Relaxed);
    pieces.expect(8);
    stage.0.next_line.store(0, Ordering::Relaxed);
    pieces.done();
    let bytes = page.0.lock().expect("not poisoned").clone();
    let text = String::from_utf8(bytes).expect("text");
    let last: serde_json::Value =
        serde_json::from_str(text.lines().last().expect("a line")).expect("JSON");
    assert_eq!((&last["items"], &last["event"]), (&0.into(), &"progress".into()));
    assert_eq!((&last["pieces"], &last["pieces_known"]), (&1.into(), &8.into()));
    drop(stage);
    // The stage has ended, so nothing is shown.
    pieces.done();
}

#[test]
fn json_lines_are_json() {
    let (text, _) = told(Mode::Json);
    let last: serde_json::Value =
        serde_json::from_str(text.lines().last().expect("a line")).expect("JSON");
    assert_eq!(last["event"], "stage_end");
    assert_eq!(last["points"], 2000);
    assert_eq!(last["items_total"], serde_json::Value::Null);
}
