//! Decodes blocks of points, in the file's frame, from the packets of one scan.

use super::packets::Packets;
use super::pages::Pages;
use super::scan::{Channel, Coordinates, E57Scan};
use contract::Result;

/// Which fields are decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WantedFields {
    /// Coordinates and invalid flags.
    Coordinates,
    /// Also rows and columns.
    Native,
    /// Also intensity and colour.
    Attributes,
}

/// Reads the points of one scan, one block of records at a time.
pub(super) struct E57Points {
    packets: Packets,
    coordinates: Option<Coordinates>,
    state: Option<usize>,
    native: Option<[usize; 2]>,
    intensity: Option<Channel>,
    color: Option<[Channel; 3]>,
    /// Metres per unit of the file.
    metres: f64,
    /// For each field whether it is decoded.
    read: Vec<bool>,
    /// The coordinate columns of the block.
    axes: [Vec<f64>; 3],
    states: Vec<i64>,
    rows_cols: [Vec<i64>; 2],
    levels: [Vec<u16>; 4],
    /// Intensities of the block as stored in the file, and a buffer for the colours.
    raw: [Vec<f64>; 2],
}

impl E57Points {
    /// Starts at the first point of a scan.
    pub(super) fn open(scan: &E57Scan, pages: Pages, wanted: WantedFields) -> Result<Self> {
        let native = scan.native.filter(|_| wanted == WantedFields::Native);
        let intensity = scan.intensity.filter(|_| wanted == WantedFields::Attributes);
        let color = scan.color.filter(|_| wanted == WantedFields::Attributes);
        let mut read = vec![false; scan.prototype.len()];
        let axes = match scan.coordinates {
            None => None,
            Some(Coordinates::Cartesian(fields) | Coordinates::Spherical(fields)) => Some(fields),
        };
        let channels = intensity.iter().chain(color.iter().flatten()).map(|c| c.field);
        for field in axes
            .into_iter()
            .flatten()
            .chain(scan.state)
            .chain(native.into_iter().flatten())
            .chain(channels)
        {
            read[field] = true;
        }
        let packets =
            Packets::open(pages, scan.file_offset, scan.n_records, &scan.prototype, &read)?;
        Ok(Self {
            packets,
            coordinates: scan.coordinates,
            state: scan.state,
            native,
            intensity,
            color,
            metres: scan.metres,
            read,
            axes: Default::default(),
            states: Vec::new(),
            rows_cols: Default::default(),
            levels: Default::default(),
            raw: Default::default(),
        })
    }

    /// Decodes at most `most` further records and returns their number; 0 only at the checked end.
    pub(super) fn next_block(&mut self, most: usize) -> Result<usize> {
        let n = self.packets.ready(most)?;
        if n == 0 {
            return Ok(0);
        }
        if let Some(Coordinates::Cartesian(fields) | Coordinates::Spherical(fields)) =
            self.coordinates
        {
            for (field, axis) in fields.into_iter().zip(&mut self.axes) {
                self.packets.numbers(field, n, axis);
            }
        }
        if let Some(Coordinates::Spherical(_)) = self.coordinates {
            self.scale_to_metres(1);
            self.convert_spherical();
        } else {
            self.scale_to_metres(3);
        }
        if let Some(field) = self.state {
            self.packets.integers(field, n, &mut self.states);
        }
        for (field, column) in self.native.into_iter().flatten().zip(&mut self.rows_cols) {
            self.packets.integers(field, n, column);
        }
        let color = self.color.map_or([None; 3], |c| c.map(Some));
        let channels = [self.intensity, color[0], color[1], color[2]];
        for (at, channel) in channels.into_iter().enumerate() {
            let Some(channel) = channel else { continue };
            let (raw, levels) = (&mut self.raw[at.min(1)], &mut self.levels[at]);
            self.packets.numbers(channel.field, n, raw);
            let (min, scale) = (channel.span.min, channel.span.scale());
            levels.clear();
            // `as` saturates at both ends and turns NaN into 0.
            levels.extend(raw.iter().map(|v| ((v - min) * scale).round() as u16));
        }
        self.packets.advance(n, &self.read);
        Ok(n)
    }

    /// Scales the first `n` columns of the block to metres; angles are not scaled.
    fn scale_to_metres(&mut self, n: usize) {
        if self.metres != 1.0 {
            let values = self.axes[..n].iter_mut().flatten();
            values.for_each(|v| *v *= self.metres);
        }
    }

    /// Converts range, azimuth and elevation of the block to x, y, z.
    fn convert_spherical(&mut self) {
        let [xs, ys, zs] = &mut self.axes;
        for ((x, y), z) in xs.iter_mut().zip(ys).zip(zs) {
            let (range, (sa, ca), (se, ce)) = (*x, y.sin_cos(), z.sin_cos());
            (*x, *y, *z) = (range * ce * ca, range * ce * sa, range * se);
        }
    }

    /// Columns x, y, z of the block, file's frame, metres.
    pub(super) fn axes(&self) -> &[Vec<f64>; 3] {
        &self.axes
    }

    /// Whether no point of this scan can be flagged as invalid.
    pub(super) fn all_valid(&self) -> bool {
        self.state.is_none()
    }

    /// Whether the file marks point `i` of the block as valid.
    #[inline]
    pub(super) fn is_valid(&self, i: usize) -> bool {
        self.state.is_none() || self.states[i] == 0
    }

    /// Point `i` of the block, file's frame, metres.
    #[inline]
    pub(super) fn xyz(&self, i: usize) -> [f64; 3] {
        [self.axes[0][i], self.axes[1][i], self.axes[2][i]]
    }

    /// Row and column of point `i` of the block; `None` where the file has none or negative ones.
    pub(super) fn native(&self, i: usize) -> Option<[u32; 2]> {
        self.native?;
        let [rows, cols] = &self.rows_cols;
        Some([u32::try_from(rows[i]).ok()?, u32::try_from(cols[i]).ok()?])
    }

    /// Intensities of the block, 0..65535; empty where the file has none.
    pub(super) fn intensity(&self) -> &[u16] {
        &self.levels[0]
    }

    /// Intensity of point `i` of the block as stored in the file.
    pub(super) fn raw_intensity(&self, i: usize) -> Option<f64> {
        self.raw[0].get(i).copied()
    }

    /// Whether the intensity of point `i` lies outside the span and was clamped.
    pub(super) fn is_cut(&self, i: usize) -> bool {
        let own = self.intensity.zip(self.raw_intensity(i));
        own.is_some_and(|(channel, value)| channel.span.cuts(value))
    }

    /// Colour of point `i` of the block, where the file has one.
    pub(super) fn color(&self, i: usize) -> Option<[u16; 3]> {
        self.color?;
        Some([self.levels[1][i], self.levels[2][i], self.levels[3][i]])
    }
}
