//! Reads windows of points that follow one another in a file, spread over it: what an unknown
//! scanner's position is found from.

use crate::file::OpenFile;
use crate::reader::{self, PointWindow, RawStrips, Want, WindowSample};
use crate::sources::Sources;
use contract::{Fan, Result, ScanId};
use geometry::{Point, Pose};

impl Sources {
    /// Windows of the points of a scan whose scanner is not known, in the order of the file. Of a
    /// format that is read from beginning to end, every point is decoded.
    ///
    /// # Errors
    /// If the input is broken where it is read; the error names its path.
    pub fn windows(
        &self,
        scan: ScanId,
        sample: WindowSample,
        fan: &dyn Fan,
    ) -> Result<Vec<PointWindow>> {
        let known = &self.scans[scan.0 as usize];
        let (file, path) = self.open(known.input)?;
        let i = (scan.0 - file.first_scan) as usize;
        let pose = known.world_from_scan;
        let starts = file.reader.window_starts(i, sample);
        let windows = match starts {
            Some(starts) => {
                // Compressed pieces begin at few places: more than one window is cut from each.
                let n_each = sample.n_windows.div_ceil(starts.len().max(1) as u64).max(1);
                let n = sample.n_points.saturating_mul(n_each) as usize;
                let read = |first| file.reader.window(first, n).map(|w| w.cut(sample.n_points));
                fan.fan(starts, read).into_iter().collect::<Result<Vec<_>>>().map(|w| w.concat())
            }
            None => file.streamed(i, &pose, sample),
        };
        let windows = file.whole(windows).map_err(|e| e.at(path.display()))?;
        Ok(windows)
    }

    /// A window that begins at a place of a LAS or LAZ file (of which it may begin earlier, at a
    /// compressed piece); `None` for formats that are read from beginning to end.
    ///
    /// # Errors
    /// If the input is broken there; the error names its path.
    pub fn window_at(&self, scan: ScanId, place: u64, n: usize) -> Result<Option<PointWindow>> {
        let (file, path) = self.open(self.scans[scan.0 as usize].input)?;
        let i = (scan.0 - file.first_scan) as usize;
        let whole = WindowSample { n_windows: 1, n_points: 1 };
        if file.reader.window_starts(i, whole).is_none() {
            return Ok(None);
        }
        let window = file.whole(file.reader.window(place, n));
        window.map(Some).map_err(|e| e.at(path.display()))
    }
}

impl PointWindow {
    /// Windows of `n` points, each but the last.
    fn cut(self, n: u64) -> Vec<Self> {
        let places = (self.place..).step_by(n.max(1) as usize);
        let points = self.points.chunks(n.max(1) as usize);
        let source_id = self.source_id;
        let one = |(points, place): (&[[f64; 3]], u64)| Self {
            place,
            source_id,
            points: points.to_vec(),
        };
        points.zip(places).map(one).collect()
    }
}

impl OpenFile {
    /// Windows of a scan that is read from its beginning to its end.
    fn streamed(&self, i: usize, pose: &Pose, sample: WindowSample) -> Result<Vec<PointWindow>> {
        let n = self.reader.scans()[i].stated_points.unwrap_or_default();
        let apart = n.div_ceil(sample.n_windows.max(1)).max(sample.n_points);
        let mut out: Vec<PointWindow> = Vec::new();
        let strips: RawStrips<'_> = match self.reader.read_scan(i) {
            Some(strips) => strips,
            None => reader::strips(&*self.reader, Want::Coordinates)?,
        };
        let mut seen = 0_u64;
        for strip in strips {
            let strip = strip?;
            if strip.scan != i {
                continue;
            }
            for (place, p) in strip.place.iter().zip(&strip.xyz) {
                let within = seen % apart;
                if within == 0 {
                    let place = strip.first_place + u64::from(*place);
                    out.push(PointWindow { place, source_id: 0, points: Vec::new() });
                }
                if let Some(last) = out.last_mut().filter(|_| within < sample.n_points) {
                    let world = pose * Point::from(p.map(f64::from));
                    last.points.push(world.coords.into());
                }
                seen += 1;
            }
        }
        Ok(out)
    }
}
