//! Settings of all stages by name: a key such as `fit.beam` and a value change one setting, and a
//! key that no stage has is refused. `tests/house.rs` compares this list with the settings of the
//! stages.

use super::method::Method;
use super::value::{SettingValue, assign};
use contract::{Error, Kind, Result};

/// Declares the settings that can be set, stage by stage.
macro_rules! settings {
    ($($room:ident: $kind:path { $($field:ident),* $(,)? })*) => {
        /// Settings of all stages.
        #[derive(Debug, Clone, Default)]
        pub struct Settings {
            /// How postures are found.
            pub method: Method,
            $(
                #[doc = concat!("Tunables of `", stringify!($kind), "`.")]
                pub $room: $kind,
            )*
        }

        impl Settings {
            /// Sets the setting with the name `stage.field`.
            ///
            /// # Errors
            /// `Usage` for an unknown name or a value of the wrong kind.
            pub fn set(&mut self, key: &str, value: &toml::Value) -> Result<()> {
                let key = &present_name(key);
                if key == METHOD {
                    return assign(&mut self.method, key, value);
                }
                $($(
                    if key == concat!(stringify!($room), ".", stringify!($field)) {
                        return assign(&mut self.$room.$field, key, value);
                    }
                )*)*
                Err(unknown(key))
            }

            /// All settings with their values, in the order of stages and fields, for the record of
            /// a run.
            #[must_use]
            pub fn all(&self) -> Vec<(&'static str, toml::Value)> {
                let mut all = vec![$($((
                    concat!(stringify!($room), ".", stringify!($field)),
                    self.$room.$field.write(),
                )),*),*];
                let first = all.iter().position(|(name, _)| name.starts_with("fit."));
                all.insert(first.unwrap_or(all.len()), (METHOD, self.method.write()));
                all
            }
        }
    };
}

/// The name of the method among the settings: it stands first among those of the stage `fit`,
/// whose work it may hand to another stage.
const METHOD: &str = "fit.method";

settings! {
    ingest: ingest::Settings {
        strip_points, max_xml_bytes, max_xml_nodes, max_xml_attributes, max_scanners_bytes, max_text_bytes,
        sample_points, max_laz_chunk_bytes, max_range, max_native_rms, min_step, max_step, units,
    }
    robot: robot::Settings {
        clouds, spacing, max_samples, max_mesh_bytes, max_mesh_growth, max_urdf_bytes, max_xml_nodes,
        max_xml_attributes,
    }
    lattice: lattice::Settings {
        noise, noise_growth, angular_noise, noise_limit, max_incidence, max_grazing, window,
        max_window_pixels, normal_tolerance, max_normal_tolerance, flatness, min_patch_points,
        min_level_area, min_level_width, min_patch_area, min_patch_width, level_tilt,
        spacing, voxel, surface_voxel, surface_noise,
    }
    view: lattice::ViewSettings {
        beams_per_cell, min_cell, empty_window,
    }
    floor: floor::Settings {
        max_tilt, max_floor_tilt, max_patch_tilt, max_step, level_tolerance, level_bend,
        max_level_tolerance, min_area, min_raised_area, raised_share, max_waviness, height_cell,
        min_cell_points, ghost_share, min_stand_area, floor_band, max_stands, stand_gap,
    }
    cluster: cluster::Settings {
        gap, clearance, slack, min_points,
    }
    base_search: base_search::Settings {
        n_coarse, n_fine, keep_feet, keep_coarse, keep_middle, max_places, bases_per_place, place_radius,
        min_score,
    }
    region: base_search::RegionSettings {
        join_gap, margin, min_height, min_extent, min_points, min_seed, max_extent, overlap,
        max_body,
    }
    fit: fit::Settings {
        beam, settle, n_search, n_judge, search_tolerance, max_step, n_refine, n_polish, thin,
        max_points, floor_band, min_noise, camera_noise, camera_alike, plane_sigma, guess_sigma,
        scan_sigma, together, calibrate, frame_sigma, determined_sigma, min_score, max_violation,
    }
    paper: baseline::Settings {
        voxel, n_neighbours, max_edge, foot_low, foot_high, max_height, geodesic_slack, max_bases,
        yaw_step, settle_steps, truncation, sparse_p, sparse_mu, sparse_rounds, sweep_step, window,
        near_symmetric, axis_weight, axis_span, gate, n_rounds,
    }
    segment: segment::Settings {
        sigma_range, sigma_cad, min_gate, max_gate, floor_band, floor_depth, foot_band, reach,
        hand_reach,
    }
    attach: attach::Settings {
        contact, thin, gap, min_voxels,
    }
    freespace: freespace::Settings {
        edge, enabled,
    }
    things: change::ThingSettings {
        min_size, min_voxels, min_points, robot_margin,
    }
    export: export::Settings {
        tiles, tile_edge, max_tiles, fixed_cloud, bodies, copc, compress, page, waiting_bytes,
    }
}

/// Former and present prefixes of names of settings, so that configurations and command lines of
/// earlier versions keep working. The first match is used.
const RENAMED: [(&str, &str); 4] = [
    ("identify.", "base_search."),
    ("merge.space_edge", "freespace.edge"),
    ("merge.space", "freespace.enabled"),
    ("merge.", "attach."),
];

/// The present name of a setting that may be given by a former one.
pub(super) fn present_name(key: &str) -> String {
    let renamed = RENAMED.iter().find_map(|(old, new)| Some((new, key.strip_prefix(old)?)));
    renamed.map_or_else(|| key.into(), |(new, rest)| format!("{new}{rest}"))
}

fn unknown(key: &str) -> Error {
    let error = Error::new(Kind::Usage, format!("there is no setting \"{key}\""));
    let all = Settings::default().all();
    let nearest = all.iter().map(|(name, _)| (distance(key, name), *name)).min();
    let room = key.split('.').next().unwrap_or(key);
    let of_room: Vec<&str> =
        all.iter().map(|(name, _)| *name).filter(|n| n.split('.').next() == Some(room)).collect();
    match nearest {
        Some((d, name)) if d <= 3 => error.hint(format!("did you mean {name}")),
        _ if !of_room.is_empty() => error.hint(format!("there are {}", of_room.join(", "))),
        _ => error.hint("a setting is called stage.name, for example fit.beam"),
    }
}

/// Number of single-letter edits between two words.
fn distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.bytes().enumerate() {
        let mut corner = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.bytes().enumerate() {
            let swap = corner + usize::from(x != y);
            corner = row[j + 1];
            row[j + 1] = swap.min(corner + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_can_be_set_to_what_it_is() {
        let mut settings = Settings::default();
        let all = settings.all();
        for (key, value) in &all {
            settings.set(key, value).expect(key);
        }
        assert!(settings.all() == all);
    }

    #[test]
    fn names_of_earlier_versions_are_understood() {
        let mut settings = Settings::default();
        settings.set("merge.space", &toml::Value::Boolean(false)).expect("a former name");
        settings.set("merge.gap", &toml::Value::Float(0.5)).expect("a former name");
        assert!(!settings.freespace.enabled && settings.attach.gap == 0.5);
    }

    #[test]
    fn typing_errors_find_their_setting() {
        assert_eq!((distance("fit.bean", "fit.beam"), distance("", "abc")), (1, 3));
    }
}
