//! The paper's claims, each against what was measured, and where one does not hold, what the other
//! measurements say on why.

mod breakdown;
mod quality;
mod speed;
mod upsampling;

use super::data::{Measured, PRPF, RPF};
use super::methods::STAGES;
use super::settings::Settings;
use crate::report::{median, number, range};

/// What a claim is, beside what was found.
pub struct Claim {
    pub claim: &'static str,
    /// Quoted.
    pub paper: &'static str,
    /// On the paper's scenes, and on ours.
    pub ours: [String; 2],
    /// What the default quality does, where that can be said.
    pub standard: String,
    /// On how many of the scenes that it is about it holds.
    pub holds: usize,
    pub of: usize,
    /// Where it does not hold; or what there is to say where it does.
    pub why: String,
}

impl Claim {
    pub fn verdict(&self) -> String {
        match (self.holds, self.of) {
            (_, 0) => "not measured".to_owned(),
            (holds, of) if holds == of => "holds".to_owned(),
            (0, _) => "no".to_owned(),
            (holds, of) => format!("on {holds} of {of}"),
        }
    }
}

/// Which scenes a claim is about.
#[derive(Clone, Copy, PartialEq)]
enum About {
    All,
    One(&'static str),
}

/// What is to be said of some scenes.
type Said<'a> = &'a dyn Fn(&[&Measured]) -> String;

/// A claim that is decided by one number of each scene.
struct Test<'a> {
    claim: &'static str,
    paper: &'static str,
    about: About,
    number: &'a dyn Fn(&Measured) -> f64,
    holds: &'a dyn Fn(&Measured) -> bool,
    shown: &'a dyn Fn(f64) -> String,
    standard: Option<&'a dyn Fn(&Measured) -> f64>,
    why: Said<'a>,
    /// What there is to say where it holds everywhere.
    remark: Option<Said<'a>>,
}

impl Test<'_> {
    fn on(&self, scenes: &[Measured]) -> Claim {
        let about = |scene: &&Measured| match self.about {
            About::All => true,
            About::One(name) => scene.name == name,
        };
        let known: Vec<&Measured> =
            scenes.iter().filter(about).filter(|scene| (self.number)(scene).is_finite()).collect();
        let failing: Vec<&Measured> = known.iter().copied().filter(|scene| !(self.holds)(scene)).collect();
        let named = if failing.len() == known.len() {
            String::new()
        } else {
            let names: Vec<&str> = failing.iter().map(|scene| scene.name.as_str()).collect();
            format!("{}: ", names.join(", "))
        };
        let shown = |of_paper: bool| {
            let group = known.iter().filter(|scene| scene.of_paper == of_paper);
            spread(group.map(|scene| (self.number)(scene)), self.shown)
        };
        let standard = self
            .standard
            .map_or_else(String::new, |number| spread(known.iter().map(|scene| number(scene)), self.shown));
        Claim {
            claim: self.claim,
            paper: self.paper,
            ours: [shown(true), shown(false)],
            standard,
            holds: known.len() - failing.len(),
            of: known.len(),
            why: match self.remark {
                _ if !failing.is_empty() => format!("{named}{}", (self.why)(&failing)),
                Some(remark) if !known.is_empty() => remark(&known),
                _ => String::new(),
            },
        }
    }
}

/// The least and the most of some numbers.
fn spread(values: impl Iterator<Item = f64>, shown: &dyn Fn(f64) -> String) -> String {
    let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let [least, most] = [least, most].map(shown);
    if values.is_empty() {
        "–".to_owned()
    } else if least == most {
        least
    } else {
        format!("{least} to {most}")
    }
}

fn times(value: f64) -> String {
    format!("{}×", number(value, 2))
}

fn percent(value: f64) -> String {
    format!("{:.0} %", 100.0 * value)
}

fn plain(value: f64) -> String {
    number(value, 2)
}

/// All claims on the scenes of a run.
pub fn claims(scenes: &[Measured], settings: &Settings) -> Vec<Claim> {
    let mut claims = speed::claims(scenes, settings);
    claims.extend(quality::claims(scenes, settings));
    claims.extend(upsampling::claims(scenes, settings));
    claims.extend(breakdown::claims(scenes, settings));
    claims
}

/// A number of some scenes, from the least to the most.
fn over(scenes: &[&Measured], number: impl Fn(&Measured) -> f64, shown: &dyn Fn(f64) -> String) -> String {
    spread(scenes.iter().map(|scene| number(scene)), shown)
}

/// The stages' shares in a run's time.
fn stages(scenes: &[&Measured], run: &str) -> String {
    let share = |stage: &str| over(scenes, |scene| scene.get(run, stage), &percent);
    STAGES.map(|stage| format!("{stage} {}", share(stage))).join(", ")
}

/// The finding: how many claims hold, and the figures that matter most.
pub fn finding(claims: &[Claim], scenes: &[Measured], settings: &Settings) -> String {
    let count = |test: &dyn Fn(&Claim) -> bool| claims.iter().filter(|claim| test(claim)).count();
    let measured = count(&|claim| claim.of > 0);
    let hold = count(&|claim| claim.of > 0 && claim.holds == claim.of);
    let fail = count(&|claim| claim.of > 0 && claim.holds == 0);
    let speed_ups = |spp: u32| range(scenes.iter().map(|scene| scene.speed_up(spp)), 2);
    let ratios = settings.spp.iter().flat_map(|&spp| {
        scenes.iter().map(move |scene| scene.at(PRPF, spp, "mse") / scene.at(RPF, spp, "mse"))
    });
    let ratios: Vec<f64> = ratios.filter(|ratio| ratio.is_finite()).collect();
    let most =
        scenes.iter().flat_map(|scene| scene.rpf_spp.iter().copied()).max().unwrap_or(settings.base_spp);
    format!(
        "**Of {measured} claims {hold} hold on every scene, {} on some, {fail} on none.** P-RPF filters {} times faster than \
         RPF at {} samples per pixel and {} times at {most}; its MSE is {} times RPF's at equal samples (median {}).",
        measured - hold - fail,
        speed_ups(settings.base_spp),
        settings.base_spp,
        speed_ups(most),
        range(ratios.iter().copied(), 2),
        number(median(ratios), 2),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ledger::values;

    fn scene(name: &str, of_paper: bool, rpf: [f64; 2], prpf: [f64; 2]) -> Measured {
        let mut scene =
            Measured { name: name.into(), of_paper, rpf_spp: vec![8, 64], runs: Default::default() };
        for (method, [few, many]) in [(RPF, rpf), (PRPF, prpf)] {
            for (spp, seconds) in [(8, few), (64, many)] {
                scene.runs.insert(format!("{method} {spp}"), values([("seconds", seconds), ("mse", 1.0)]));
            }
        }
        scene
    }

    fn settings() -> Settings {
        crate::settings::read(&crate::settings::package_folder().join("paper.toml"), false).unwrap()
    }

    #[test]
    fn a_claim_holds_where_its_scenes_say_so_and_says_why_elsewhere() {
        let fast = scene("dof-dragons", true, [5.0, 320.0], [1.0, 1.0]);
        let slow = scene("ajar", false, [5.0, 20.0], [1.0, 2.0]);
        let all = claims(&[fast, slow], &settings());
        let by_name = |start: &str| all.iter().find(|claim| claim.claim.starts_with(start)).unwrap();
        let growth = by_name("RPF's filter time grows");
        assert_eq!((growth.ours[0].as_str(), growth.ours[1].as_str()), ("64×", "4.0×"));
        assert_eq!((growth.holds, growth.of, growth.verdict().as_str()), (1, 2, "on 1 of 2"));
        assert!(growth.why.starts_with("ajar: takes 4.0× for 8.0×"), "{}", growth.why);
        assert_eq!(by_name("P-RPF filters faster than RPF at 8").verdict(), "holds");
        assert_eq!(by_name("Pixels whose weights").verdict(), "not measured");
        assert_eq!(by_name("P-RPF's MSE").why, "");
    }

    #[test]
    fn the_finding_counts_the_claims() {
        let scenes = [scene("pool", false, [5.0, 320.0], [1.0, 1.0])];
        let all = claims(&scenes, &settings());
        let finding = finding(&all, &scenes, &settings());
        assert!(finding.contains("5.0 times faster") && finding.contains("320 times at 64"), "{finding}");
    }
}
