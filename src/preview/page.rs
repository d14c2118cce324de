//! The files of the page, compiled into the program: plain HTML, CSS and JavaScript modules, served unchanged.

macro_rules! files {
    ($($path:literal: $kind:literal = $name:literal),* $(,)?) => {
        &[$(($path, $kind, include_bytes!(concat!("page/", $name)).as_slice())),*]
    };
}

const FILES: &[(&str, &str, &[u8])] = files![
    "/": "text/html; charset=utf-8" = "index.html",
    "/style.css": "text/css; charset=utf-8" = "style.css",
    "/main.js": "text/javascript; charset=utf-8" = "main.js",
    "/camera_panel.js": "text/javascript; charset=utf-8" = "camera_panel.js",
    "/colour_scale.js": "text/javascript; charset=utf-8" = "colour_scale.js",
    "/comparison.js": "text/javascript; charset=utf-8" = "comparison.js",
    "/connection.js": "text/javascript; charset=utf-8" = "connection.js",
    "/discarding.js": "text/javascript; charset=utf-8" = "discarding.js",
    "/error_curve.js": "text/javascript; charset=utf-8" = "error_curve.js",
    "/frame.js": "text/javascript; charset=utf-8" = "frame.js",
    "/half_float.js": "text/javascript; charset=utf-8" = "half_float.js",
    "/inspector.js": "text/javascript; charset=utf-8" = "inspector.js",
    "/number_field.js": "text/javascript; charset=utf-8" = "number_field.js",
    "/panel.js": "text/javascript; charset=utf-8" = "panel.js",
    "/pointer_input.js": "text/javascript; charset=utf-8" = "pointer_input.js",
    "/scenes.js": "text/javascript; charset=utf-8" = "scenes.js",
    "/sheet.js": "text/javascript; charset=utf-8" = "sheet.js",
    "/viewport.js": "text/javascript; charset=utf-8" = "viewport.js",
    "/views.js": "text/javascript; charset=utf-8" = "views.js",
    "/icon.svg": "image/svg+xml" = "icon.svg",
];

/// Returns content type and content of the file at a URL path.
pub fn file(path: &str) -> Option<(&'static str, &'static [u8])> {
    FILES.iter().find(|(at, ..)| *at == path).map(|&(_, kind, body)| (kind, body))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_other_host_is_named() {
        for (path, _, body) in FILES {
            let text = std::str::from_utf8(body).unwrap();
            let elsewhere = text.match_indices("://").filter(|(at, _)| {
                // XML namespaces are names only; the WebSocket's URL is built from the page's own.
                !text[..*at].ends_with("http") || !text[*at..].starts_with("://www.w3.org/")
            });
            let own = elsewhere.filter(|(at, _)| !text[*at..].starts_with("://${location.host}"));
            assert_eq!(own.count(), 0, "{path}");
        }
    }

    #[test]
    fn every_module_that_is_imported_is_served() {
        for (path, _, body) in FILES {
            let text = std::str::from_utf8(body).unwrap();
            for (at, _) in text.match_indices("from \"./") {
                let name = text[at + 7..].split('"').next().unwrap();
                assert!(file(name).is_some(), "{path} imports {name}");
            }
        }
    }
}
