use prpf::{
    filter::{Quality, filter},
    stats::*,
};
fn main() {
    let layout = Layout::with_blocks(|_| true);
    let (w, h) = (512, 512);
    let mut store = Store::new(w, h, layout.clone(), 4, 0);
    let mut s = 1u64;
    let mut r = || {
        s ^= s << 13;
        s ^= s >> 7;
        s ^= s << 17;
        (s >> 40) as f32 / 16777216.0
    };
    let n = layout.len();
    let t = std::time::Instant::now();
    for y in 0..h {
        for x in 0..w {
            let mut v = vec![0.0f32; n * 8];
            for q in v.iter_mut() {
                *q = r();
            }
            for k in 0..8 {
                let base = if (x / 64 + y / 64) % 2 == 0 { 0.2 } else { 0.8 };
                for c in layout.block(Block::Albedo).unwrap() {
                    v[k * n + c] = base;
                }
                for c in layout.block(Block::Normal1).unwrap() {
                    v[k * n + c] = base + 0.1 * v[k * n + c];
                }
                for c in layout.block(Block::Emission).unwrap() {
                    v[k * n + c] = 0.0;
                }
            }
            store.push(x, y, &v);
        }
    }
    println!("push {:?} per sample ns {}", t.elapsed(), t.elapsed().as_nanos() as f64 / (w * h * 8) as f64);
    for q in [Quality::Standard, Quality::Draft] {
        for _ in 0..5 {
            let t = std::time::Instant::now();
            let f = filter(&store, q, 0);
            println!("{:?} {}", t.elapsed(), f.image.at(0, 10, 10));
        }
    }
}
