//! Batches of tiles in, written behind the back of the sink that gathers the next ones; their entries out in the end.

use super::catalogue::TileEntry;
use super::encode::Encode;
use super::file::TileFile;
use super::parts::Part;
use super::record::{PixelOrder, Record};
use contract::{Error, Kind, Result};
use crossbeam::channel::{Receiver, Sender, bounded, unbounded};
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};

/// Tiles with the numbers of their buffers.
type Batch = Vec<(usize, Part)>;
/// The file, and the entries of what is in it.
type Written = (TileFile, Vec<(usize, TileEntry)>);

/// A thread that encodes tiles and appends them to a file.
pub(super) struct Writer {
    batches: Option<Sender<Batch>>,
    /// Memory of records that are written: fresh memory costs as much as what is done with it.
    free: Receiver<Vec<Record>>,
    thread: Option<JoinHandle<Result<Written>>>,
}

impl Writer {
    pub(super) fn start(file: TileFile, encode: &Arc<Encode>) -> Result<Self> {
        // One batch waits while another is written: memory is bounded by both.
        let (batches, taken) = bounded(1);
        let encode = Arc::clone(encode);
        let (give, free) = unbounded();
        let thread = Builder::new()
            .name("store writer".into())
            .spawn(move || work(file, &encode, &taken, &give))
            .map_err(|e| Error::new(Kind::Io, "a thread could not be started").because(e))?;
        Ok(Self { batches: Some(batches), free, thread: Some(thread) })
    }

    /// Memory that was used before; none where there is none.
    pub(super) fn room(&self) -> Vec<Record> {
        self.free.try_recv().unwrap_or_default()
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

fn work(
    mut file: TileFile,
    encode: &Encode,
    batches: &Receiver<Batch>,
    free: &Sender<Vec<Record>>,
) -> Result<Written> {
    let (mut order, mut bytes) = (PixelOrder::default(), Vec::new());
    let mut written = Vec::new();
    for (i, mut part) in batches.iter().flatten() {
        let encoded = encode.encode(&mut part, &mut order, bytes);
        written.push((i, file.append(&encoded)?));
        bytes = encoded.bytes;
        part.records.clear();
        // The sink is at its end where nobody wants it.
        let _ = free.send(part.records);
    }
    Ok((file, written))
}
