//! The order in which replies are made: one that reads another's signal comes after it.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use super::behaviour::{Reply, reads_tick_before};

/// The places of `replies` in an order in which each comes after those whose signals it reads, and else in that of the
/// file; or the places along a circle of replies that read each other.
pub(crate) fn order(replies: &[&Reply]) -> Result<Vec<usize>, Vec<usize>> {
    let makers: HashMap<usize, usize> = (replies.iter().enumerate())
        .flat_map(|(place, reply)| reply.outputs.iter().map(move |signal| (*signal, place)))
        .collect();
    let needs = |place: usize| {
        let inputs = replies[place].inputs.iter();
        let inputs = inputs.filter(move |_| !reads_tick_before(replies[place].kind));
        inputs.filter_map(|signal| makers.get(signal).copied())
    };
    let mut missing: Vec<usize> = (0..replies.len())
        .map(|place| needs(place).count())
        .collect();
    let mut readers: Vec<Vec<usize>> = vec![Vec::new(); replies.len()];
    for place in 0..replies.len() {
        for maker in needs(place) {
            readers[maker].push(place);
        }
    }
    let ready = (0..replies.len()).filter(|place| missing[*place] == 0);
    let mut ready: BinaryHeap<_> = ready.map(Reverse).collect();
    let mut order = Vec::with_capacity(replies.len());
    while let Some(Reverse(place)) = ready.pop() {
        order.push(place);
        for reader in &readers[place] {
            missing[*reader] -= 1;
            if missing[*reader] == 0 {
                ready.push(Reverse(*reader));
            }
        }
    }
    let Some(first) = (0..replies.len()).find(|place| missing[*place] > 0) else {
        return Ok(order);
    };
    // Each reply that is left needs one that is left: the way from one to the next comes to a circle.
    let mut way = vec![first];
    loop {
        let here = way[way.len() - 1];
        let next = needs(here)
            .find(|maker| missing[*maker] > 0)
            .unwrap_or(here);
        if let Some(begin) = way.iter().position(|place| *place == next) {
            return Err(way.split_off(begin));
        }
        way.push(next);
    }
}
