//! Batches of tiles in, written behind the back of the sink that gathers the next ones; their
//! entries out in the end. Threads in turn encode tiles while another one waits for the disk to
//! take those before.

use super::catalogue::TileEntry;
use super::encode::{Encode, Encoded};
use super::file::TileFile;
use super::record::{PixelOrder, Record, TilePart};
use contract::{Error, Kind, Result};
use crossbeam::channel::{Receiver, Sender, bounded, unbounded};
use std::sync::Arc;
use std::thread::{Builder, JoinHandle, ScopedJoinHandle};

/// Tiles with the numbers of their buffers.
type Batch = Vec<(usize, TilePart)>;
/// The file, and the entries of what is in it.
type Written = (TileFile, Vec<(usize, TileEntry)>);

/// Threads that encode: two do it faster than a disk takes what they make.
const ENCODERS: usize = 2;
/// Tiles that wait for each of them, and encoded ones of each that wait for the disk, at most: a
/// megabyte or two each.
const WAITING: usize = 2;

/// Threads that encode tiles and append them to a file.
pub(super) struct Writer {
    batches: Option<Sender<Batch>>,
    /// Memory of records that are written, no more than is of use: fresh memory costs as much as
    /// what is done with it.
    free: Receiver<Vec<Record>>,
    thread: Option<JoinHandle<Result<Written>>>,
}

impl Writer {
    /// Starts them; the memory of so many tiles is kept to be used again.
    pub(super) fn start(file: TileFile, encode: &Arc<Encode>, n_free: usize) -> Result<Self> {
        // One batch waits while another is written: memory is bounded by both.
        let (batches, taken) = bounded(1);
        let encode = Arc::clone(encode);
        let (give, free) = bounded(n_free);
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
        // In turn, so that they come out in turn as well. Who appends has failed where nobody takes
        // any more, and says why.
        for (turn, part) in batches.iter().flatten().enumerate() {
            if gives[turn % ENCODERS].send(part).is_err() {
                break;
            }
        }
        drop(gives);
        let lost = || Error::new(Kind::Bug, "a thread of the writer of tiles was lost");
        let is_lost = encoders.into_iter().map(ScopedJoinHandle::join).any(|end| end.is_err());
        let written = append.join().map_err(|_| lost())?;
        if is_lost { Err(lost()) } else { written }
    })
}

/// Encodes tiles, in memory that was used before where there is some.
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
        // The sink has enough, or is at its end, where nobody takes it.
        let _ = free.try_send(part.records);
        if done.send((i, encoded)).is_err() {
            return;
        }
    }
}

/// Appends encoded tiles, of each encoder in turn; gives their memory back.
fn append(
    mut file: TileFile,
    encoders: &[Receiver<(usize, Encoded)>],
    give_back: &Sender<Vec<u8>>,
) -> Result<Written> {
    let mut written = Vec::new();
    for (i, encoded) in encoders.iter().cycle().map_while(|tiles| tiles.recv().ok()) {
        written.push((i, file.append(&encoded)?));
        // Nobody encodes any more where nobody wants it.
        let _ = give_back.send(encoded.bytes);
    }
    Ok((file, written))
}
