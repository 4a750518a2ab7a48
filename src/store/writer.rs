//! Writes batches of tiles in the background while the sink gathers the next ones. Threads encode
//! tiles in turn, and another thread appends them to the file in order.

use super::catalogue::TileEntry;
use super::encode::{Encode, Encoded};
use super::file::TileFile;
use super::record::{PixelOrder, Record, TilePart};
use contract::{Error, Kind, Result};
use crossbeam::channel::{Receiver, Sender, bounded, unbounded};
use std::sync::Arc;
use std::thread::{Builder, JoinHandle, ScopedJoinHandle};

/// Tiles with the indices of their buffers.
type Batch = Vec<(usize, TilePart)>;
/// The tile file, and the entries of the tiles in it.
type Written = (TileFile, Vec<(usize, TileEntry)>);

/// Number of encoding threads: two encode faster than a disk writes.
const ENCODERS: usize = 2;
/// Most tiles that wait for each encoder, and most encoded tiles of each that wait for the disk: a
/// megabyte or two each.
const WAITING: usize = 2;

/// Threads that encode tiles and append them to a file.
pub(super) struct Writer {
    batches: Option<Sender<Batch>>,
    /// Memory of written records, kept for later tiles: fresh memory costs as much time as
    /// encoding.
    free: Receiver<Vec<Record>>,
    thread: Option<JoinHandle<Result<Written>>>,
}

impl Writer {
    /// Starts the threads; the memory of `n_free` tiles is kept for later ones.
    pub(super) fn start(file: TileFile, encode: &Arc<Encode>, n_free: usize) -> Result<Self> {
        // One batch waits while another is written, so that both bound the memory.
        let (batches, taken) = bounded(1);
        let encode = Arc::clone(encode);
        let (give, free) = bounded(n_free);
        let thread = Builder::new()
            .name("store writer".into())
            .spawn(move || work(file, &encode, &taken, &give))
            .map_err(|e| Error::new(Kind::Io, "a thread could not be started").because(e))?;
        Ok(Self { batches: Some(batches), free, thread: Some(thread) })
    }

    /// Memory of a written tile; an empty vector where there is none.
    pub(super) fn room(&self) -> Vec<Record> {
        self.free.try_recv().unwrap_or_default()
    }

    /// Passes a batch to the threads, and waits where the disk is slower than the points come.
    pub(super) fn write(&mut self, batch: Batch) -> Result<()> {
        let taken = self.batches.as_ref().is_some_and(|batches| batches.send(batch).is_ok());
        // A writer whose channel is closed has failed; its result holds the error.
        if taken { Ok(()) } else { self.end().map(drop) }
    }

    /// Waits until all batches are written.
    pub(super) fn finish(mut self) -> Result<Written> {
        self.end()
    }

    fn end(&mut self) -> Result<Written> {
        drop(self.batches.take());
        let lost = || Error::new(Kind::Bug, "the thread that writes tiles ended without a result");
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(written)) => written,
            Some(Err(_)) | None => Err(lost()),
        }
    }
}

fn work(
    file: TileFile,
    encode: &Encode,
    batches: &Receiver<Batch>,
    free: &Sender<Vec<Record>>,
) -> Result<Written> {
    let (give_back, rooms) = unbounded();
    std::thread::scope(|scope| {
        let start = |name: &str| Builder::new().name(name.into());
        let failed = |e| Error::new(Kind::Io, "a thread could not be started").because(e);
        let (mut encoders, mut gives, mut takes) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..ENCODERS {
            let ((give, parts), (done, encoded)) = (bounded(WAITING), bounded(WAITING));
            let (free, rooms) = (free.clone(), rooms.clone());
            let work = move || encode_all(encode, &parts, &done, &free, &rooms);
            encoders.push(start("store encoder").spawn_scoped(scope, work).map_err(failed)?);
            gives.push(give);
            takes.push(encoded);
        }
        let append = move || append(file, &takes, &give_back);
        let append = start("store disk").spawn_scoped(scope, append).map_err(failed)?;
        // Tiles are passed to the encoders in turn and taken back in turn, which keeps their order.
        // If the appending thread has failed, its result holds the error.
        for (turn, part) in batches.iter().flatten().enumerate() {
            if gives[turn % ENCODERS].send(part).is_err() {
                break;
            }
        }
        drop(gives);
        let lost = || Error::new(Kind::Bug, "a thread that encodes tiles ended without a result");
        let is_lost = encoders.into_iter().map(ScopedJoinHandle::join).any(|end| end.is_err());
        let written = append.join().map_err(|_| lost())?;
        if is_lost { Err(lost()) } else { written }
    })
}

/// Encodes tiles, in memory of earlier tiles where there is some.
fn encode_all(
    encode: &Encode,
    parts: &Receiver<(usize, TilePart)>,
    done: &Sender<(usize, Encoded)>,
    free: &Sender<Vec<Record>>,
    rooms: &Receiver<Vec<u8>>,
) {
    let mut order = PixelOrder::default();
    for (i, mut part) in parts {
        let room = rooms.try_recv().unwrap_or_default();
        let encoded = encode.encode(&mut part, &mut order, room);
        part.records.clear();
        // Nobody takes the memory where the sink has enough or has ended.
        let _ = free.try_send(part.records);
        if done.send((i, encoded)).is_err() {
            return;
        }
    }
}

/// Appends encoded tiles, one of each encoder in turn, and returns their memory.
fn append(
    mut file: TileFile,
    encoders: &[Receiver<(usize, Encoded)>],
    give_back: &Sender<Vec<u8>>,
) -> Result<Written> {
    let mut written = Vec::new();
    for (i, encoded) in encoders.iter().cycle().map_while(|tiles| tiles.recv().ok()) {
        written.push((i, file.append(&encoded)?));
        // Nobody takes the memory where the encoders have ended.
        let _ = give_back.send(encoded.bytes);
    }
    Ok((file, written))
}
