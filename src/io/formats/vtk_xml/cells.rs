//! Unstructured grids: the pieces one after another.

use glam::DVec3;

use crate::error::Result;
use crate::io::build::arrays::ArrayInfo;
use crate::io::build::dataset::{self, Dataset};
use crate::io::build::origin::Origin;
use crate::io::file::decode;
use crate::io::file::source::Source;
use crate::io::file::text::index;
use crate::io::formats::vtk_xml::File;
use crate::io::formats::vtk_xml::document::{Document, Piece, Section};
use crate::io::formats::vtk_xml::pieces::{append, numbers, part, section, tuples};
use crate::io::formats::vtk_xml::store::Store;
use crate::io::options::ReadOptions;
use crate::io::report::Loaded;
use crate::scene::Samples;

impl File<'_> {
    /// Reads an unstructured grid as a mesh, or as points if it has no cells with volume.
    pub(crate) fn cells(&mut self, format: &'static str, options: &ReadOptions) -> Result<Loaded> {
        let source = self.source;
        let Document { pieces, kind, .. } = &self.document;
        let sum = |count: fn(&Piece) -> u64| pieces.iter().map(count).fold(0, u64::saturating_add);
        let (points, cells) = (sum(|piece| piece.points), sum(|piece| piece.cells));
        index(source, "NumberOfPoints", points)?;
        index(source, "NumberOfCells", cells)?;
        self.budget.take("points and cells", dataset::bytes(points, cells, 0))?;
        let points = read_points(source, &mut self.store, pieces)?;
        let (ends, nodes_of_pieces) = read_ends(source, &mut self.store, pieces)?;
        let all = nodes_of_pieces.iter().copied().fold(0, u64::saturating_add);
        self.budget.take("nodes of cells", dataset::bytes(0, 0, all))?;
        let nodes = read_nodes(source, &mut self.store, pieces, &nodes_of_pieces)?;
        let types = read_types(source, &mut self.store, pieces)?;
        let data = Dataset { points, types, ends, nodes };

        let full = pieces.iter().filter(|piece| piece.points > 0).count();
        if full > 1 {
            self.notes.push(format!("{full} pieces were joined"));
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

/// The coordinates of the points of all pieces.
fn read_points(source: &Source, store: &mut Store, pieces: &[Piece]) -> Result<Vec<DVec3>> {
    let mut list = Vec::new();
    for piece in pieces.iter().filter(|piece| piece.points > 0) {
        let array = part(source, piece, Section::Points, None, 3)?;
        let count = index(source, "NumberOfPoints", piece.points)?;
        store.take(array, numbers(source, array, piece.points, 3)?, &mut |reader, kind, endian| {
            decode::append_points(reader, count, kind, endian, &mut list)
        })?;
    }
    Ok(list)
}

/// Where the nodes of each cell end, counted over all pieces, and the number of nodes of each piece. Node lists that are
/// text give their length nowhere else.
fn read_ends(source: &Source, store: &mut Store, pieces: &[Piece]) -> Result<(Vec<u32>, Vec<u64>)> {
    let mut list = Vec::new();
    let mut of_pieces = Vec::new();
    let mut nodes = 0_u64;
    for piece in pieces {
        let mut last = 0;
        each(source, store, piece, ("offsets", piece.cells), &mut list, &mut |end| {
            last = u64::from(end);
            let end = u32::try_from(nodes.saturating_add(last));
            end.map_err(|_| "more nodes than 32 bits can count".to_owned())
        })?;
        nodes = nodes.saturating_add(last);
        of_pieces.push(last);
    }
    Ok((list, of_pieces))
}

/// The nodes of all cells, as indices into the points of all pieces.
fn read_nodes(source: &Source, store: &mut Store, pieces: &[Piece], counts: &[u64]) -> Result<Vec<u32>> {
    let mut list = Vec::new();
    let mut before = 0_u64;
    for (piece, &count) in pieces.iter().zip(counts) {
        each(source, store, piece, ("connectivity", count), &mut list, &mut |node| {
            if u64::from(node) >= piece.points {
                return Err(format!("node {node}: the piece has {} points", piece.points));
            }
            let node = u32::try_from(before + u64::from(node));
            node.map_err(|_| "more points than 32 bits can count".to_owned())
        })?;
        before = before.saturating_add(piece.points);
    }
    Ok(list)
}

/// The VTK type numbers of all cells.
fn read_types(source: &Source, store: &mut Store, pieces: &[Piece]) -> Result<Vec<u8>> {
    let mut list = Vec::new();
    for piece in pieces {
        each(source, store, piece, ("types", piece.cells), &mut list, &mut |number| {
            u8::try_from(number).map_err(|_| format!("{number}: not a type of a cell"))
        })?;
    }
    Ok(list)
}

/// Reads `count` whole numbers of an array of a piece, if it has cells, and appends what `value` makes of them.
fn each<T>(
    source: &Source,
    store: &mut Store,
    piece: &Piece,
    (name, count): (&str, u64),
    list: &mut Vec<T>,
    value: &mut dyn FnMut(u32) -> std::result::Result<T, String>,
) -> Result<()> {
    if piece.cells == 0 {
        return Ok(());
    }
    let array = part(source, piece, Section::Cells, Some(name), 1)?;
    let numbers = index(source, &array.at(), count)?;
    store.take(array, count, &mut |reader, kind, endian| {
        list.try_reserve_exact(numbers).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
        decode::each_index(reader, numbers, kind, endian, &mut |number| {
            value(number).map(|value| list.push(value))
        })
    })
}
