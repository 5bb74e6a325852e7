//! Unstructured grids: the pieces one after another.

use glam::DVec3;

use crate::error::Result;
use crate::io::build::dataset::{self, Dataset};
use crate::io::build::origin::Origin;
use crate::io::file::decode::{self, Values};
use crate::io::file::text::index;
use crate::io::formats::vtk_xml::document::{Piece, Section};
use crate::io::formats::vtk_xml::store::Store;
use crate::io::formats::vtk_xml::{File, VtkXml};
use crate::io::options::Request;
use crate::io::reader::Reader as _;
use crate::io::report::Found;

impl File<'_> {
    /// Reads an unstructured grid as a mesh, or as points if it has no cells with volume.
    pub(crate) fn cells(&mut self, request: &Request) -> Result<Found> {
        let source = self.source;
        let pieces = &self.document.pieces;
        let sum = |count: fn(&Piece) -> u64| pieces.iter().map(count).fold(0, u64::saturating_add);
        let (points, cells) = (sum(|piece| piece.points), sum(|piece| piece.cells));
        index(source, "NumberOfPoints", points)?;
        index(source, "NumberOfCells", cells)?;
        self.budget.take("points and cells", dataset::bytes(points, cells, 0))?;
        let points = read_points(&mut self.store, pieces)?;
        let (ends, nodes_of_pieces) = read_ends(&mut self.store, pieces)?;
        let all = nodes_of_pieces.iter().copied().fold(0, u64::saturating_add);
        self.budget.take("nodes of cells", dataset::bytes(0, 0, all))?;
        let nodes = read_nodes(&mut self.store, pieces, &nodes_of_pieces)?;
        let types = read_types(&mut self.store, pieces)?;
        let data = Dataset { points, types, ends, nodes };

        let full = pieces.iter().filter(|piece| piece.points > 0).count();
        if full > 1 {
            self.notes.push(format!("{full} pieces were joined"));
        }
        let arrays = self.arrays.clone();
        let store = &mut self.store;
        let mut read = |index: usize, pick| {
            let info = &arrays[index];
            let mut values = Values::none(info.kind, info.components, pick);
            pieces.iter().try_for_each(|piece| store.values(piece, info, pick, &mut values))?;
            Ok(values)
        };
        let (arrays, budget, read) = (arrays.clone(), &mut self.budget, &mut read);
        data.build(Origin { source, format: VtkXml.name(), arrays, spare: 0..0, request, budget, read })
    }
}

/// The coordinates of the points of all pieces.
fn read_points(store: &mut Store, pieces: &[Piece]) -> Result<Vec<DVec3>> {
    let mut list = Vec::new();
    for piece in pieces.iter().filter(|piece| piece.points > 0) {
        let array = piece.part(store.source, Section::Points, None, 3)?;
        let count = index(store.source, "NumberOfPoints", piece.points)?;
        let numbers = store.numbers(array, piece.points)?;
        store.take(array, numbers, &mut |reader, kind, endian| {
            decode::append_points(reader, count, kind, endian, &mut list)
        })?;
    }
    Ok(list)
}

/// Where the nodes of each cell end, counted over all pieces, and the number of nodes of each piece. Node lists that are
/// text give their length nowhere else.
fn read_ends(store: &mut Store, pieces: &[Piece]) -> Result<(Vec<u32>, Vec<u64>)> {
    let mut list = Vec::new();
    let mut of_pieces = Vec::new();
    let mut nodes = 0_u64;
    for piece in pieces {
        let mut last = 0;
        each(store, piece, ("offsets", piece.cells), &mut list, &mut |end| {
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
fn read_nodes(store: &mut Store, pieces: &[Piece], counts: &[u64]) -> Result<Vec<u32>> {
    let mut list = Vec::new();
    let mut before = 0_u64;
    for (piece, &count) in pieces.iter().zip(counts) {
        each(store, piece, ("connectivity", count), &mut list, &mut |node| {
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
fn read_types(store: &mut Store, pieces: &[Piece]) -> Result<Vec<u8>> {
    let mut list = Vec::new();
    for piece in pieces {
        each(store, piece, ("types", piece.cells), &mut list, &mut |number| {
            u8::try_from(number).map_err(|_| format!("{number}: not a type of a cell"))
        })?;
    }
    Ok(list)
}

/// Reads `count` whole numbers of an array of a piece, if it has cells, and appends what `value` makes of them.
fn each<T>(
    store: &mut Store,
    piece: &Piece,
    (name, count): (&str, u64),
    list: &mut Vec<T>,
    value: &mut dyn FnMut(u32) -> std::result::Result<T, String>,
) -> Result<()> {
    if piece.cells == 0 {
        return Ok(());
    }
    let array = piece.part(store.source, Section::Cells, Some(name), 1)?;
    let numbers = index(store.source, &array.at(), count)?;
    store.take(array, count, &mut |reader, kind, endian| {
        list.try_reserve_exact(numbers).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
        decode::each_index(reader, numbers, kind, endian, &mut |number| {
            value(number).map(|value| list.push(value))
        })
    })
}
