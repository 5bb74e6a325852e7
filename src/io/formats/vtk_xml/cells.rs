//! Unstructured grids: the pieces one after another.

use glam::DVec3;

use crate::error::Result;
use crate::io::build::arrays::ArrayInfo;
use crate::io::build::dataset::{self, Dataset};
use crate::io::build::origin::Origin;
use crate::io::file::decode;
use crate::io::file::text::index;
use crate::io::formats::vtk_xml::document::{Document, Piece, Section};
use crate::io::formats::vtk_xml::file::File;
use crate::io::formats::vtk_xml::pieces::{append, in_chunks, numbers, part, section, tuples, wrong};
use crate::io::options::ReadOptions;
use crate::io::report::Loaded;
use crate::scene::Samples;

impl File<'_> {
    /// Cells, or points.
    pub(crate) fn cells(&mut self, format: &'static str, options: &ReadOptions) -> Result<Loaded> {
        let source = self.source;
        let Document { pieces, kind, .. } = &self.document;
        let sum = |count: fn(&Piece) -> u64| pieces.iter().map(count).fold(0, u64::saturating_add);
        let (points, cells) = (sum(|piece| piece.points), sum(|piece| piece.cells));
        index(source, "NumberOfPoints", points)?;
        index(source, "NumberOfCells", cells)?;
        self.budget.take("points and cells", dataset::bytes(points, cells, 0))?;
        let mut data = Dataset::default();

        for piece in pieces.iter().filter(|piece| piece.points > 0) {
            let array = part(source, piece, Section::Points, None, 3)?;
            let count = numbers(source, array, piece.points, 3)?;
            let list = &mut data.points;
            self.store.take(array, count, &mut |reader, kind, endian| {
                let count = usize::try_from(count).unwrap_or(usize::MAX);
                list.try_reserve_exact(count / 3).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
                in_chunks(reader, count, kind, endian, decode::append_f64, &mut |chunk| {
                    list.extend(chunk.as_chunks::<3>().0.iter().map(|&point| DVec3::from_array(point)));
                    Ok(())
                })
            })?;
        }

        // Where the nodes of each piece end. Those that are text say nowhere else how many they are.
        let mut ends: Vec<u64> = Vec::new();
        let mut nodes = 0_u64;
        for piece in pieces.iter().filter(|piece| piece.cells > 0) {
            let array = part(source, piece, Section::Cells, Some("offsets"), 1)?;
            let list = &mut data.ends;
            let count = index(source, &array.at(), piece.cells)?;
            let mut last = 0;
            self.store.take(array, piece.cells, &mut |reader, kind, endian| {
                list.try_reserve_exact(count).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
                in_chunks(reader, count, kind, endian, decode::append_indices, &mut |chunk| {
                    for &end in chunk {
                        last = end;
                        let end = nodes.checked_add(u64::from(end)).and_then(|end| u32::try_from(end).ok());
                        list.push(end.ok_or_else(|| wrong("more nodes than 32 bits can count".to_owned()))?);
                    }
                    Ok(())
                })
            })?;
            nodes = nodes.saturating_add(u64::from(last));
            ends.push(u64::from(last));
        }
        self.budget.take("nodes of cells", dataset::bytes(0, 0, nodes))?;

        let mut before = 0_u64;
        let mut ends = ends.into_iter();
        for piece in pieces {
            if piece.cells > 0 {
                let array = part(source, piece, Section::Cells, Some("connectivity"), 1)?;
                let count = ends.next().unwrap_or_default();
                let list = &mut data.nodes;
                self.store.take(array, count, &mut |reader, kind, endian| {
                    let count = usize::try_from(count).unwrap_or(usize::MAX);
                    list.try_reserve_exact(count).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
                    in_chunks(reader, count, kind, endian, decode::append_indices, &mut |chunk| {
                        for &node in chunk {
                            if u64::from(node) >= piece.points {
                                return Err(wrong(format!(
                                    "node {node}: the piece has {} points",
                                    piece.points
                                )));
                            }
                            let node = u32::try_from(before + u64::from(node));
                            list.push(
                                node.map_err(|_| wrong("more points than 32 bits can count".to_owned()))?,
                            );
                        }
                        Ok(())
                    })
                })?;
            }
            before = before.saturating_add(piece.points);
        }

        for piece in pieces.iter().filter(|piece| piece.cells > 0) {
            let array = part(source, piece, Section::Cells, Some("types"), 1)?;
            let count = index(source, &array.at(), piece.cells)?;
            let list = &mut data.types;
            self.store.take(array, piece.cells, &mut |reader, kind, endian| {
                list.try_reserve_exact(count).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
                in_chunks(reader, count, kind, endian, decode::append_indices, &mut |chunk| {
                    for &number in chunk {
                        list.push(
                            u8::try_from(number)
                                .map_err(|_| wrong(format!("{number}: no type of a cell")))?,
                        );
                    }
                    Ok(())
                })
            })?;
        }

        let full = pieces.iter().filter(|piece| piece.points > 0).count();
        if full > 1 {
            self.notes.push(format!("{full} pieces were put together"));
        }
        let arrays = self.arrays.clone();
        let origin = Origin { source, format, arrays: arrays.clone() };
        let store = &mut self.store;
        data.build(
            origin,
            &mut self.budget,
            &mut |index, pick| {
                let ArrayInfo { name, association, kind: number, .. } = &arrays[index];
                let mut samples = Samples::none(*number, pick);
                for piece in pieces {
                    let count = tuples(*kind, piece, *association);
                    if let Some(array) = piece.array(section(*association), name).filter(|_| count > 0) {
                        append(store, array, count, pick, &mut samples, source)?;
                    }
                }
                Ok(samples)
            },
            options,
        )
    }
}
