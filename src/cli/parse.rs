//! Parsers of options' values. Their errors name what was found and what is accepted.

use std::net::SocketAddr;
use std::num::NonZeroUsize;

use super::debug_sample::DebugSample;
use crate::adaptive::PrioritySettings;
use crate::render::Shard;
use crate::scene::film::{MAX_PIXELS, MAX_SIDE};

/// Parses `90`, `20s`, `5m`, `1h30m`, `1.5m` or `500ms` to seconds.
pub(super) fn duration(text: &str) -> Result<f64, String> {
    let error = || format!("found `{text}`; accepted are durations such as 20s, 5m, 1h30m, 500ms");
    let mut seconds = 0.0;
    let mut rest = text.trim();
    if rest.is_empty() {
        return Err(error());
    }
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        let value: f64 = rest[..digits].parse().map_err(|_| error())?;
        rest = &rest[digits..];
        let unit = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let factor = match &rest[..unit] {
            "ms" => 1e-3,
            "s" | "" => 1.0,
            "m" | "min" => 60.0,
            "h" => 3600.0,
            _ => return Err(error()),
        };
        seconds += value * factor;
        rest = &rest[unit..];
    }
    if seconds.is_finite() { Ok(seconds) } else { Err(error()) }
}

pub(super) fn non_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.is_finite() => Ok(value),
        _ => Err(format!("found `{text}`; accepted are numbers from 0 (off) up")),
    }
}

pub(super) fn resolution(text: &str) -> Result<[usize; 2], String> {
    let sides: Option<[u32; 2]> =
        text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    // Whether these fit in memory is checked before they are allocated.
    let fits = |&[w, h]: &[u32; 2]| {
        [w, h].iter().all(|side| (1..=MAX_SIDE).contains(side)) && u64::from(w) * u64::from(h) <= MAX_PIXELS
    };
    sides.filter(fits).map(|sides| sides.map(|side| side as usize)).ok_or_else(|| {
        format!(
            "found `{text}`; accepted is WIDTHxHEIGHT with sides from 1 to {MAX_SIDE} and at most {MAX_PIXELS} \
             pixels, e.g. 640x480"
        )
    })
}

pub(super) fn bounds(text: &str) -> Result<[usize; 4], String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    numbers
        .and_then(|n| n.try_into().ok())
        .ok_or_else(|| format!("found `{text}`; accepted are four whole numbers X0,X1,Y0,Y1"))
}

pub(super) fn sample(text: &str) -> Result<DebugSample, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, index]) => Ok(DebugSample { x: x as usize, y: y as usize, index }),
        _ => Err(format!("found `{text}`; accepted are three whole numbers X,Y,INDEX, e.g. 64,32,0")),
    }
}

pub(super) fn address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| {
        format!("found `{text}`; accepted is ADDR:PORT, e.g. 0.0.0.0:8080 (the scene goes before --preview)")
    })
}

pub(super) fn host(text: &str) -> Result<String, String> {
    match text.rsplit_once(':') {
        Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => Ok(text.to_owned()),
        _ => Err(format!("found `{text}`; accepted is HOST:PORT, e.g. localhost:14158")),
    }
}

pub(super) fn drive(text: &str) -> Result<PrioritySettings, String> {
    let mut settings = PrioritySettings::default();
    let mut named = Vec::new();
    for item in text.split(',').filter(|item| !item.is_empty()) {
        let error = || {
            format!(
                "found `{item}`; accepted are filtered-variance, raw-variance, interpolation-failure and residual, \
                 each =WEIGHT from 0 up"
            )
        };
        let (map, weight) = item.split_once('=').ok_or_else(error)?;
        if named.contains(&map) {
            return Err(format!("found {map} twice; accepted is one weight of each map"));
        }
        named.push(map);
        let weight: f32 =
            weight.parse().ok().filter(|w: &f32| *w >= 0.0 && w.is_finite()).ok_or_else(error)?;
        match map {
            "filtered-variance" => settings.filtered_variance = weight,
            "raw-variance" => settings.raw_variance = weight,
            "interpolation-failure" => settings.interpolation_failure = weight,
            "residual" => settings.residual = weight,
            _ => return Err(error()),
        }
    }
    Ok(settings)
}

/// More sample vectors per pixel add nothing.
const LARGEST_RESERVOIR: usize = 1024;

pub(super) fn reservoir(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n) if n <= LARGEST_RESERVOIR => Ok(n),
        _ => Err(format!("found `{text}`; accepted are whole numbers from 0 to {LARGEST_RESERVOIR}")),
    }
}

pub(super) fn shard(text: &str) -> Result<Shard, String> {
    text.split_once('/').and_then(|(k, n)| Shard::new(k.parse().ok()?, n.parse().ok()?)).ok_or_else(|| {
        format!("found `{text}`; accepted is K/N with 1 <= K <= N <= {}, e.g. 2/4", Shard::MOST)
    })
}

/// More threads than this are a typing error, and would bring the machine down.
const MOST_THREADS: usize = 1024;

pub(super) fn threads(text: &str) -> Result<NonZeroUsize, String> {
    match text.parse::<NonZeroUsize>() {
        Ok(n) if n.get() <= MOST_THREADS => Ok(n),
        _ => Err(format!("found `{text}`; accepted are whole numbers from 1 to {MOST_THREADS}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_read_as_people_write_them() {
        for (text, seconds) in
            [("20s", 20.0), ("5m", 300.0), ("1h30m", 5400.0), ("0.5m", 30.0), ("500ms", 0.5), ("7", 7.0)]
        {
            assert_eq!(duration(text), Ok(seconds), "{text}");
        }
        for text in ["", "s", "5x", "-3s", "1..2s", "ten"] {
            assert!(duration(text).unwrap_err().contains("20s"), "{text}");
        }
    }

    #[test]
    fn resolutions_and_bounds_are_checked() {
        assert_eq!(resolution("640x480"), Ok([640, 480]));
        assert!(
            resolution("640").is_err() && resolution("0x5").is_err() && resolution("9x99999999").is_err()
        );
        assert_eq!(bounds("0,10,5,20"), Ok([0, 10, 5, 20]));
        assert!(bounds("1,2,3").is_err());
        assert_eq!(sample("3,4,5"), Ok(DebugSample { x: 3, y: 4, index: 5 }));
        assert!(sample("3,4").is_err() && sample("3,-4,5").is_err());
    }

    #[test]
    fn shards_are_counted_from_one_up_to_a_limit() {
        assert_eq!(shard("2/4").ok(), Shard::new(2, 4));
        assert_eq!(shard("65536/65536").ok(), Shard::new(65_536, 65_536));
        for text in ["0/4", "5/4", "1", "1/65537"] {
            assert!(shard(text).unwrap_err().contains("K <= N <= 65536"), "{text}");
        }
    }

    #[test]
    fn drive_weights_change_what_they_name() {
        let priority = drive("residual=0,filtered-variance=2").unwrap();
        assert_eq!((priority.residual, priority.filtered_variance), (0.0, 2.0));
        assert_eq!(priority.raw_variance, PrioritySettings::default().raw_variance);
        assert!(drive("colour=1").is_err() && drive("residual=-1").is_err());
    }
}
