//! The table of the eleven LAS point formats: where the fields of a record lie.

/// Where the fields of a point format lie, bytes from the start of the record.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RecordLayout {
    /// Shortest record.
    pub(crate) len: usize,
    /// Formats 6 to 10: flags, class and source id lie elsewhere.
    pub(crate) modern: bool,
    /// GPS time.
    pub(crate) gps_time: Option<usize>,
    /// Red, green, blue.
    pub(crate) color: Option<usize>,
}

/// LAS 1.4 R15, tables 7 to 17.
pub(crate) const LAYOUTS: [RecordLayout; 11] = [
    RecordLayout { len: 20, modern: false, gps_time: None, color: None },
    RecordLayout { len: 28, modern: false, gps_time: Some(20), color: None },
    RecordLayout { len: 26, modern: false, gps_time: None, color: Some(20) },
    RecordLayout { len: 34, modern: false, gps_time: Some(20), color: Some(28) },
    RecordLayout { len: 57, modern: false, gps_time: Some(20), color: None },
    RecordLayout { len: 63, modern: false, gps_time: Some(20), color: Some(28) },
    RecordLayout { len: 30, modern: true, gps_time: Some(22), color: None },
    RecordLayout { len: 36, modern: true, gps_time: Some(22), color: Some(30) },
    RecordLayout { len: 38, modern: true, gps_time: Some(22), color: Some(30) },
    RecordLayout { len: 59, modern: true, gps_time: Some(22), color: None },
    RecordLayout { len: 67, modern: true, gps_time: Some(22), color: Some(30) },
];

impl RecordLayout {
    /// The layout of a point format.
    pub(crate) fn of(format: u8) -> Option<Self> {
        LAYOUTS.get(usize::from(format)).copied()
    }

    /// Whether the file marks the point as not to be used.
    #[inline]
    pub(crate) fn withheld(self, record: &[u8]) -> bool {
        if self.modern { record[15] & 0b100 != 0 } else { record[15] & 0b1000_0000 != 0 }
    }

    /// Point source id.
    #[inline]
    pub(crate) fn source_id(self, record: &[u8]) -> u16 {
        u16_at(record, if self.modern { 20 } else { 18 })
    }

    /// Class.
    #[inline]
    pub(crate) fn classification(self, record: &[u8]) -> u8 {
        if self.modern { record[16] } else { record[15] & 0b1_1111 }
    }
}

#[inline]
pub(crate) fn u16_at(record: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([record[at], record[at + 1]])
}
