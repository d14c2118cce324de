//! Every hard case holds. The cases are those of `prpf-experiments stability`.

#[path = "../experiments/stability/cases/mod.rs"]
mod cases;

use cases::SECTIONS;
use cases::case::Case;
use cases::effort::Effort;

/// Runs a section; `PRPF_FULL=1` runs it at full length.
fn section_holds(name: &str) {
    let effort = if std::env::var_os("PRPF_FULL").is_some() { Effort::Full } else { Effort::Test };
    let section = SECTIONS.iter().find(|section| section.name == name).expect("a section of this name");
    let cases = (section.cases)(effort);
    // Shown where a test fails, or with --nocapture.
    cases.iter().for_each(|case| println!("{case}"));
    assert!(!cases.is_empty() && cases.iter().all(Case::passed), "{name}");
}

macro_rules! sections {
    ($($test:ident: $name:literal),*) => {
        $(#[test] fn $test() { section_holds($name); })*

        #[test]
        fn every_section_is_tested() {
            assert_eq!([$($name),*], SECTIONS.map(|section| section.name));
        }
    };
}

sections! {
    statistics_hold: "Statistics",
    radiance_holds: "Radiance",
    features_hold: "Features",
    images_hold: "Images",
    unusual_stores_hold: "Unusual stores",
    scenes_hold: "Scenes",
    light_and_surfaces_hold: "Light and surfaces",
    the_loop_holds: "The loop",
    files_hold: "Files"
}
