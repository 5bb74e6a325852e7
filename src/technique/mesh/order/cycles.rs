//! Cycles of relations: finds them, counts them, and orders their nodes with few relations dropped.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::num;
use crate::scene::topology::NONE;

/// An order of all nodes, and the cycles that were broken for it.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Broken {
    /// Nodes in order.
    pub order: Vec<u32>,
    /// Strongly connected components of more than one node.
    pub components: u32,
    /// Nodes in them.
    pub nodes: u32,
    /// Relations dropped.
    pub dropped: u64,
}

/// A directed graph: edges sorted by source, and for each node the edges that end there.
struct Graph {
    edges: Vec<[u32; 2]>,
    starts: Vec<usize>,
    incoming: Vec<u32>,
    incoming_starts: Vec<usize>,
}

impl Graph {
    fn new(nodes: usize, mut edges: Vec<[u32; 2]>) -> Self {
        edges.sort_unstable();
        edges.dedup();
        let starts = (0..=nodes).map(|node| edges.partition_point(|e| num::index(e[0]) < node)).collect();
        let mut incoming: Vec<u32> = (0..num::count(edges.len())).collect();
        incoming.sort_by_key(|&e| edges[num::index(e)][1]);
        let target = |e: &u32| num::index(edges[num::index(*e)][1]);
        let incoming_starts =
            (0..=nodes).map(|node| incoming.partition_point(|e| target(e) < node)).collect();
        Self { edges, starts, incoming, incoming_starts }
    }

    fn leaving(&self, node: u32) -> std::ops::Range<usize> {
        self.starts[num::index(node)]..self.starts[num::index(node) + 1]
    }

    fn ending_at(&self, node: u32) -> &[u32] {
        &self.incoming[self.incoming_starts[num::index(node)]..self.incoming_starts[num::index(node) + 1]]
    }

    /// Returns the sizes of the strongly connected components of more than one node (Tarjan 1972, without recursion).
    fn components(&self) -> Vec<u32> {
        let nodes = num::count(self.starts.len() - 1);
        let mut low = vec![NONE; num::index(nodes)];
        let mut open = Vec::new();
        let mut walk: Vec<(u32, usize, u32)> = Vec::new();
        let mut sizes = Vec::new();
        // The mark of closed components is above the numbers of all open nodes.
        let (mut next, closed) = (0, NONE - 1);
        for root in 0..nodes {
            if low[num::index(root)] != NONE {
                continue;
            }
            let mut enter = Some(root);
            loop {
                if let Some(node) = enter.take() {
                    low[num::index(node)] = next;
                    open.push(node);
                    walk.push((node, self.leaving(node).start, next));
                    next += 1;
                }
                let Some((node, edge, number)) = walk.last_mut() else { break };
                let node = *node;
                if *edge < self.leaving(node).end {
                    let to = self.edges[*edge][1];
                    *edge += 1;
                    match low[num::index(to)] {
                        NONE => enter = Some(to),
                        other if other == closed => {}
                        other => low[num::index(node)] = low[num::index(node)].min(other),
                    }
                    continue;
                }
                let (least, number) = (low[num::index(node)], *number);
                walk.pop();
                if least == number {
                    let begin = open.iter().rposition(|&other| other == node).unwrap_or(0);
                    for &member in &open[begin..] {
                        low[num::index(member)] = closed;
                    }
                    if open.len() - begin > 1 {
                        sizes.push(num::count(open.len() - begin));
                    }
                    open.truncate(begin);
                } else if let Some(&(parent, ..)) = walk.last() {
                    low[num::index(parent)] = low[num::index(parent)].min(least);
                }
            }
        }
        sizes
    }
}

/// Orders nodes: the free node with the least key comes next; a node is free once all its predecessors are sorted.
///
/// Where no node is free, a walk finds a cycle: it starts at the node with the least key, and goes from each node to its
/// predecessor with the least key. The node of the cycle with the least key loses the relation to its predecessor in the
/// cycle. So each dropped relation is part of a cycle of relations that are still kept, and nodes that are only behind a
/// cycle lose none.
///
/// After a cycle is broken the walk continues from where it stopped, and may repeat steps. After 64 steps for each
/// relation it drops whichever relation closes the cycle, and repeats no step.
pub(crate) fn order(keys: &[u64], edges: Vec<[u32; 2]>) -> Broken {
    let graph = Graph::new(keys.len(), edges);
    let sizes = graph.components();
    let mut broken =
        Broken { components: num::count(sizes.len()), nodes: sizes.iter().sum(), ..Broken::default() };
    let mut held: Vec<usize> = (0..num::count(keys.len())).map(|node| graph.ending_at(node).len()).collect();
    let mut free: BinaryHeap<_> = (0..num::count(keys.len()))
        .filter(|&node| held[num::index(node)] == 0)
        .map(|node| Reverse((keys[num::index(node)], node)))
        .collect();
    let mut nearest: Vec<u32> = (0..num::count(keys.len())).collect();
    nearest.sort_unstable_by_key(|&node| (keys[num::index(node)], node));
    let mut nearest = nearest.into_iter();
    let mut done = vec![false; keys.len()];
    let mut dropped = vec![false; graph.edges.len()];
    // Nodes of the walk, each with the edge from it to the node before.
    let mut path: Vec<(u32, usize)> = Vec::new();
    let mut place = vec![usize::MAX; keys.len()];
    let mut steps = graph.edges.len().saturating_mul(64);
    loop {
        while let Some(Reverse((_, node))) = free.pop() {
            done[num::index(node)] = true;
            broken.order.push(node);
            for edge in graph.leaving(node).filter(|&edge| !dropped[edge]) {
                let to = graph.edges[edge][1];
                held[num::index(to)] -= 1;
                if held[num::index(to)] == 0 {
                    free.push(Reverse((keys[num::index(to)], to)));
                }
            }
        }
        if broken.order.len() == keys.len() {
            return broken;
        }
        while let Some(&(node, _)) = path.last().filter(|(node, _)| done[num::index(*node)]) {
            place[num::index(node)] = usize::MAX;
            path.pop();
        }
        let Some(node) =
            path.last().map(|last| last.0).or_else(|| nearest.find(|&node| !done[num::index(node)]))
        else {
            return broken;
        };
        if path.is_empty() {
            place[num::index(node)] = 0;
            path.push((node, 0));
        }
        let holding =
            graph.ending_at(node).iter().map(|&edge| (num::index(edge), graph.edges[num::index(edge)][0]));
        let holding = holding.filter(|&(edge, from)| !dropped[edge] && !done[num::index(from)]);
        let Some((edge, from)) = holding.min_by_key(|&(_, from)| (keys[num::index(from)], from)) else {
            return broken;
        };
        let begin = place[num::index(from)];
        if begin == usize::MAX {
            place[num::index(from)] = path.len();
            path.push((from, edge));
            steps = steps.saturating_sub(1);
            continue;
        }
        // The edge into a node of the cycle is stored with the next node on the path.
        let cut = if steps == 0 {
            path.len() - 1
        } else {
            let key = |at: &usize| (keys[num::index(path[*at].0)], path[*at].0);
            (begin..path.len()).min_by_key(key).unwrap_or(begin)
        };
        let edge = path.get(cut + 1).map_or(edge, |next| next.1);
        for (node, _) in path.drain(cut + 1..) {
            place[num::index(node)] = usize::MAX;
        }
        dropped[edge] = true;
        broken.dropped += 1;
        let to = graph.edges[edge][1];
        held[num::index(to)] -= 1;
        if held[num::index(to)] == 0 {
            free.push(Reverse((keys[num::index(to)], to)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_of_a_known_graph() {
        let graph = Graph::new(
            8,
            vec![[0, 1], [1, 2], [2, 0], [2, 3], [3, 4], [4, 3], [4, 5], [6, 5], [6, 7], [0, 2]],
        );
        let mut sizes = graph.components();
        sizes.sort_unstable();
        assert_eq!(sizes, [2, 3]);
    }

    #[test]
    fn what_is_behind_a_cycle_loses_nothing() {
        // 3 has the least key but stands behind the cycle of 0, 1 and 2.
        let broken = order(&[30, 20, 40, 10], vec![[0, 1], [1, 2], [2, 0], [2, 3], [2, 3]]);
        assert_eq!(broken, Broken { order: vec![1, 2, 3, 0], components: 1, nodes: 3, dropped: 1 });
    }

    #[test]
    fn random_graphs_keep_every_relation_that_is_not_dropped() {
        let mut state = 7_u64;
        let mut next = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        for trial in 0..300 {
            let nodes = 2 + next(40);
            let keys: Vec<u64> = (0..nodes).map(|_| next(1000)).collect();
            let mut edges: Vec<[u32; 2]> = (0..next(120))
                .map(|_| [next(nodes), next(nodes)].map(|i| u32::try_from(i).unwrap()))
                .filter(|e| e[0] != e[1])
                .collect();
            if trial % 2 == 0 {
                // Without cycles.
                edges.iter_mut().for_each(|edge| edge.sort_unstable());
            }
            let broken = order(&keys, edges.clone());
            let mut rank = vec![usize::MAX; keys.len()];
            for (i, &node) in broken.order.iter().enumerate() {
                rank[num::index(node)] = i;
            }
            assert!(rank.iter().all(|&rank| rank != usize::MAX));
            edges.sort_unstable();
            edges.dedup();
            let wrong = edges.iter().filter(|e| rank[num::index(e[0])] > rank[num::index(e[1])]).count();
            // A dropped relation may still be kept by chance, but no other relation is violated.
            assert!(num::wide(wrong) <= broken.dropped);
            assert_eq!(broken.components == 0, broken.dropped == 0);
            assert!(trial % 2 == 1 || broken.components == 0);
        }
    }
}
