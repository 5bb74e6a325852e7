//! VTK's XML files.

use volraster::io::{Data, read};
use crate::support::{self, OPTIONS};

#[test]
#[ignore]
fn dump() {
    use std::io::Write;
    let jobs = std::fs::read_to_string("/tmp/hA/jobs.txt").unwrap();
    for line in jobs.lines() {
        let f: Vec<&str> = line.split('\t').collect();
        let mut options = OPTIONS;
        if !f[1].is_empty() { options.array = Some(f[1].to_owned()); }
        let write = |ext: &str, bytes: Vec<u8>| std::fs::File::create(format!("{}.{ext}", f[2])).unwrap().write_all(&bytes).unwrap();
        match read(f[0], &options) {
            Err(e) => println!("{}\tERR\t{e}", f[2]),
            Ok(l) => {
                let (what, values): (String, Vec<f32>) = match &l.data {
                    Data::Grid(g) => {
                        let p = (g.dims(), g.index_to_world(), g.origin());
                        (format!("{p:?}"), support::stored(g).iter().map(|&x| x as f32).collect())
                    }
                    Data::Mesh(m) => {
                        write("points", m.points().iter().flat_map(|p| p.to_array()).flat_map(|x| x.to_le_bytes()).collect());
                        write("cells", m.cells().iter().flatten().flat_map(|x| x.to_le_bytes()).collect());
                        (format!("{} {}", m.points().len(), m.cells().len()), m.scalars().values().to_vec())
                    }
                    Data::Points(m) => {
                        write("points", m.centres().iter().flat_map(|p| p.to_array()).flat_map(|x| x.to_le_bytes()).collect());
                        (format!("{}", m.centres().len()), m.scalars().map(<[f32]>::to_vec).unwrap_or_default())
                    }
                    _ => unreachable!(),
                };
                write("values", values.iter().flat_map(|x| x.to_le_bytes()).collect());
                println!("{}\t{}\t{}\t{:?}\t{:?}\t{:?}", f[2], l.data.kind(), what, l.report.shown, l.report.notes, l.report.warnings);
            }
        }
    }
}
