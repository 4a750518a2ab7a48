//! Batches of tiles in, written behind the back of the sink that gathers the next ones; their entries out in the end.

use super::catalogue::TileEntry;
use super::encode::Encode;
use super::file::TileFile;
use super::parts::Part;
use super::record::PixelOrder;
use contract::{Error, Kind, Map, Result};
use crossbeam::channel::{Receiver, Sender, bounded};
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};

/// Tiles with the numbers of their buffers.
type Batch = Vec<(usize, Part)>;
/// The file, and the entries of what is in it.
type Written = (TileFile, Vec<(usize, TileEntry)>);

/// A thread that encodes tiles and appends them to a file.
pub(super) struct Writer {
    batches: Option<Sender<Batch>>,
    thread: Option<JoinHandle<Result<Written>>>,
}

impl Writer {
    pub(super) fn start(file: TileFile, encode: &Arc<Encode>) -> Result<Self> {
        // One batch waits while another is written: memory is bounded by both.
        let (batches, taken) = bounded(1);
        let encode = Arc::clone(encode);
        let thread = Builder::new()
            .name("store writer".into())
            .spawn(move || work(file, &encode, &taken))
            .map_err(|e| Error::new(Kind::Io, "a thread could not be started").because(e))?;
        Ok(Self { batches: Some(batches), thread: Some(thread) })
    }

    /// Hands a batch over; waits where the disk is slower than the points come.
    pub(super) fn write(&mut self, batch: Batch) -> Result<()> {
        let taken = self.batches.as_ref().is_some_and(|batches| batches.send(batch).is_ok());
        // A writer that has gone has failed, and says why.
        if taken { Ok(()) } else { self.end().map(drop) }
    }

    /// Waits for all that was handed over.
    pub(super) fn finish(mut self) -> Result<Written> {
        self.end()
    }

    fn end(&mut self) -> Result<Written> {
        drop(self.batches.take());
        let lost = || Error::new(Kind::Bug, "the writer of tiles was lost");
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(written)) => written,
            Some(Err(_)) | None => Err(lost()),
        }
    }
}

fn work(mut file: TileFile, encode: &Encode, batches: &Receiver<Batch>) -> Result<Written> {
    let mut order = PixelOrder::default();
    let mut written = Vec::new();
    for (i, part) in batches.iter().flatten() {
        written.push((i, file.append(encode.apply(part, &mut order)?)?));
    }
    Ok((file, written))
}
