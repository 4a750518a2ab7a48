//! Reads scans and points of E57 files (ASTM E2807). The XML description is parsed by the crate
//! `e57`; the points are decoded here.

mod describe;
mod file;
mod look;
mod packets;
mod pages;
mod points;
mod scan;
mod stream;
mod strips;

use crate::oddities::Oddities;
use crate::reader::{FileReading, MaskSeed, RawStrips, Reader, SampledPoint, ScanSeed, Want};
use crate::settings::Settings;
use crate::units::{self, Choice, Units};
use ::e57::E57Reader;
use contract::{Error, Format, Kind, Result, XmlLimits, check_xml};
use file::E57File;
use pages::{PAGE, Pages};
use scan::E57Scan;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Number of bytes of the description that are read at a time: the most that [`Pages::read`] gives.
const AT_ONCE: usize = 64 << 10;
/// Length of the file header, bytes.
const HEADER: usize = 48;

/// Opens an E57 file: header, description and the first points of each scan are read and checked.
pub(crate) fn open(path: &Path, settings: &Settings) -> Result<Box<dyn Reader>> {
    check_header(&mut Pages::open(path)?, settings)?;
    let reader = E57Reader::new(BufReader::new(File::open(path)?)).map_err(describe)?;
    let mut file = E57File {
        path: path.to_path_buf(),
        settings: settings.clone(),
        masks: Vec::new(),
        scans: Vec::new(),
        files: Vec::new(),
        oddities: Vec::new(),
        facts: facts(&reader),
        units: units(&reader, path, settings)?,
    };
    let metres = file.units.horizontal.metres;
    for (n, cloud) in reader.pointclouds().iter().enumerate() {
        let name = match cloud.name.as_deref().map(str::trim) {
            Some(name) if !name.is_empty() => name.to_string(),
            _ => format!("scan {}", n + 1),
        };
        let (scan, mut seed) = E57Scan::new(path, cloud, &name, metres, settings)
            .map_err(|e| e.at(format!("scan \"{name}\"")))?;
        seed.mask = n;
        file.facts.push((format!("scan {} fields", n + 1), fields(cloud)));
        file.masks.push(scan.mask(&name));
        file.scans.push(seed);
        file.files.push(scan);
        file.oddities.push(Oddities::default());
    }
    Ok(Box::new(file))
}

impl Reader for E57File {
    fn format(&self) -> Format {
        Format::E57
    }

    fn masks(&self) -> &[MaskSeed] {
        &self.masks
    }

    fn scans(&self) -> &[ScanSeed] {
        &self.scans
    }

    fn sample(&self, scan: usize, n: usize) -> Result<Vec<SampledPoint>> {
        strips::sample(self, &self.files[scan], n)
            .map_err(|e| e.at(format!("scan \"{}\"", self.scans[scan].name)))
    }

    fn spread(&self, scan: usize, n: usize, most: u64) -> Result<Vec<[f32; 3]>> {
        strips::spread(self, &self.files[scan], n, most)
            .map_err(|e| e.at(format!("scan \"{}\"", self.scans[scan].name)))
    }

    fn read(&self, want: Want) -> Result<FileReading<'_>> {
        Ok(FileReading::Straight(Box::new(strips::E57Strips::new(self, want))))
    }

    fn units(&self) -> &Units {
        &self.units
    }

    fn read_scan(&self, scan: usize) -> Option<RawStrips<'_>> {
        Some(Box::new(strips::E57Strips::of_scan(self, scan)))
    }

    fn oddities(&self, scan: usize) -> Option<&Oddities> {
        self.oddities.get(scan)
    }

    fn has_color(&self) -> bool {
        self.files.iter().any(|scan| scan.color.is_some())
    }

    fn facts(&self) -> Vec<(String, String)> {
        self.facts.clone()
    }
}

/// Checks the header before any of its numbers is used as a size.
fn check_header(pages: &mut Pages, settings: &Settings) -> Result<()> {
    let header: [u8; HEADER] = pages.read(0, HEADER)?.try_into().expect("as long as asked");
    let number =
        |from: usize| u64::from_le_bytes(*header[from..].first_chunk().expect("within the header"));
    let place = "page 0";
    if !header.starts_with(b"ASTM-E57") {
        return Err(Error::bad_input("file does not begin as E57 files do").at(place));
    }
    let version = u32::from_le_bytes(*header[8..].first_chunk().expect("within the header"));
    if version != 1 {
        return Err(Error::new(
            Kind::Unsupported,
            format!("version of E57 is not read, \"{version}\""),
        )
        .at(place));
    }
    if number(40) != PAGE {
        return Err(Error::new(
            Kind::Unsupported,
            format!("page size is not {PAGE} bytes, but \"{}\"", number(40)),
        )
        .at(place));
    }
    if number(16) > pages.len_on_disk() {
        return Err(Error::bad_input(format!(
            "file is truncated: {} bytes of the announced \"{}\"",
            pages.len_on_disk(),
            number(16)
        ))
        .at(place)
        .hint("copy the file again"));
    }
    let (offset, len) = (number(24), number(32));
    let start = pages.logical(offset).map_err(|e| e.at(place))?;
    if len > settings.max_xml_bytes {
        let (limit, way) = (settings.max_xml_bytes, "raise --set ingest.max_xml_bytes");
        let what = format!("description of the file is longer than {limit} bytes, \"{len}\"");
        return Err(Error::bad_input(what).at(place).hint(format!("if the file is right, {way}")));
    }
    if start.checked_add(len).is_none_or(|end| end > pages.len()) {
        return Err(Error::bad_input(format!(
            "description of the file reaches outside it, bytes \"{len}\""
        ))
        .at(place));
    }
    // Each page of the description is checked here, so that an error names the page, and its nodes
    // are counted before the XML reader keeps all of them.
    let mut text = Vec::new();
    while (text.len() as u64) < len {
        let n = (len as usize - text.len()).min(AT_ONCE);
        let piece = pages.read(start + text.len() as u64, n).map_err(|e| e.at("description"))?;
        text.extend_from_slice(piece);
    }
    let limits = XmlLimits {
        max_nodes: settings.max_xml_nodes,
        max_attributes: settings.max_xml_attributes,
        room: "ingest",
    };
    check_xml(&text, &limits).map_err(|what| Error::bad_input(what).at("description"))
}

/// Translates an error of the crate that parses descriptions.
fn describe(e: ::e57::Error) -> Error {
    let (kind, what) = match &e {
        ::e57::Error::NotImplemented { .. } => {
            (Kind::Unsupported, "description of the file has unsupported content")
        }
        ::e57::Error::Internal { .. } => {
            (Kind::BadInput, "description of the file cannot be parsed")
        }
        _ => (Kind::BadInput, "description of the file is broken"),
    };
    Error::new(kind, what).because(e).hint("export the file again")
}

/// Units of the file's coordinates, which are metres by the standard; a reference system with
/// another unit is mentioned.
fn units(reader: &E57Reader<BufReader<File>>, path: &Path, settings: &Settings) -> Result<Units> {
    let mut out = Units::of_format(Choice::read(&settings.units)?.of(path))?;
    let system = reader.coordinate_metadata().and_then(|text| units::of_wkt(text.as_bytes()));
    if let Some(Ok(declared)) = system.map(|system| Units::of(&[system], None))
        && !declared.is_metres()
    {
        out.remarks.push(format!(
            "its reference system is in {}, but coordinates of E57 are in metres by the standard",
            declared.horizontal
        ));
    }
    Ok(out)
}

/// Facts about the file from its header, for `inspect`.
fn facts(reader: &E57Reader<BufReader<File>>) -> Vec<(String, String)> {
    let header = reader.header();
    let clouds = reader.pointclouds();
    let mut facts = vec![
        ("version".into(), format!("E57 {}.{}", header.major, header.minor)),
        ("records".into(), clouds.iter().map(|c| u128::from(c.records)).sum::<u128>().to_string()),
    ];
    if let Some(library) = reader.library_version() {
        facts.push(("written by".into(), library.into()));
    }
    if let Some(system) = reader.coordinate_metadata().filter(|s| !s.is_empty()) {
        facts.push(("coordinate system".into(), system.into()));
    }
    let n_images = reader.images().len();
    if n_images > 0 {
        facts.push(("images, not read".into(), n_images.to_string()));
    }
    for extension in reader.extensions() {
        facts.push((
            "extension, not read".into(),
            format!("{} {}", extension.namespace, extension.url),
        ));
    }
    facts
}

/// The fields of one scan, in words.
fn fields(cloud: &::e57::PointCloud) -> String {
    let mut words = vec![format!("{} records", cloud.records)];
    let flags = [
        (cloud.has_cartesian(), "Cartesian"),
        (cloud.has_spherical(), "spherical"),
        (cloud.has_row_column(), "rows and columns"),
        (cloud.has_intensity(), "intensity"),
        (cloud.has_color(), "colour"),
        (cloud.has_return(), "several returns"),
        (cloud.transform.is_some(), "pose"),
    ];
    words.extend(flags.iter().filter(|(has, _)| *has).map(|(_, word)| (*word).to_string()));
    let sensor: Vec<&str> = [&cloud.sensor_vendor, &cloud.sensor_model]
        .into_iter()
        .flatten()
        .map(String::as_str)
        .collect();
    if !sensor.is_empty() {
        words.push(format!("sensor {}", sensor.join(" ")));
    }
    words.join(", ")
}

#[cfg(test)]
mod odd_tests;
#[cfg(test)]
mod own_tests;
#[cfg(test)]
mod tests;
