//! A running preview of a small scene.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::process::{Running, first_line};

/// A ball on a floor, under a lamp.
pub const SCENE: &str = r#"
LookAt 0 1.5 -4  0 0 0  0 1 0
Camera "perspective" "float fov" 40
Integrator "path" "integer maxdepth" 3
Film "rgb" "integer xresolution" 96 "integer yresolution" 64 "string filename" "named.exr"
WorldBegin
LightSource "infinite" "rgb L" [ 0.2 0.25 0.3 ]
AttributeBegin
AreaLightSource "diffuse" "rgb L" [ 6 5 4 ]
Translate 2 3 -1
Shape "sphere" "float radius" 0.5
AttributeEnd
Material "diffuse" "rgb reflectance" [ 0.7 0.2 0.2 ]
Shape "sphere" "float radius" 1
Material "diffuse" "rgb reflectance" [ 0.5 0.5 0.5 ]
Shape "trianglemesh" "point3 P" [ -9 -1 -9  9 -1 -9  9 -1 9  -9 -1 9 ] "integer indices" [ 0 1 2 0 2 3 ]
"#;

/// A folder with the scene in `scene.pbrt`.
pub fn folder_with_scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("scene.pbrt"), SCENE).expect("a file in it");
    folder
}

/// Starts the program on the scene in a folder, with a page; returns the page's URL as well.
pub fn start_in(folder: &Path, command: &str, arguments: &[&str]) -> (Running, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_prpf"))
        .current_dir(folder)
        .args([command, "scene.pbrt"])
        .args(arguments)
        .stdout(Stdio::piped())
        .spawn()
        .map(Running)
        .expect("the program starts");
    let output = program.0.stdout.take().expect("it was asked for");
    let address = first_line(output, |line| line.strip_prefix("preview at ").map(str::to_owned));
    (program, address.expect("the program says where the page is"))
}

/// Starts a preview in a folder of its own; returns its URL as well.
pub fn preview(arguments: &[&str]) -> (Running, String, tempfile::TempDir) {
    let folder = folder_with_scene();
    let (program, address) = start_in(folder.path(), "preview", arguments);
    (program, address, folder)
}

/// A viewer's connection.
pub type Socket = tungstenite::WebSocket<tungstenite::stream::MaybeTlsStream<std::net::TcpStream>>;

/// Connects a viewer without a browser.
pub fn viewer(address: &str) -> Socket {
    use tungstenite::client::IntoClientRequest;
    let own = address.trim_end_matches('/');
    let mut request = own.replace("http", "ws").into_client_request().unwrap();
    *request.uri_mut() = format!("{}/live", own.replace("http", "ws")).parse().unwrap();
    request.headers_mut().insert("Origin", own.parse().unwrap());
    tungstenite::connect(request).expect("a socket").0
}
