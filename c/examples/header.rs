//! Prints `prpf.h`, made of the comments and functions of the library:
//! `cargo run -p prpf-c --example header > c/prpf.h`.

use std::path::Path;

fn main() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(package.join("cbindgen.toml")).expect("cbindgen.toml is right");
    let sources = ["version", "status", "threads", "denoisers", "store", "filter", "result", "allocation"];
    let builder = sources.iter().fold(cbindgen::Builder::new().with_config(config), |builder, name| {
        builder.with_src(package.join(format!("src/{name}.rs")))
    });
    let mut header = Vec::new();
    builder.generate().expect("the interface is one of C").write(&mut header);
    let header = String::from_utf8(header).expect("sources are UTF-8");
    let includes = "#include <stdint.h>\n";
    let version = format!(
        "{includes}\n/* The version of this header; prpf_version() returns the library's. */\n#define PRPF_VERSION \"{}\"\n",
        env!("CARGO_PKG_VERSION")
    );
    // What the caller promises is said without the heading that Rust's lints ask for.
    print!("{}", header.replace(" * # Safety\n", "").replace(includes, &version));
}
