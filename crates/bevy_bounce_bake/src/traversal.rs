//! The order in which the cube map is swept over the surface, and the blocks that are encoded together.

mod order;

use std::fmt;
use std::str::FromStr;

use bevy_bounce_cssm::block::LANES;
use glam::Vec3;

use crate::atlas::Atlas;

/// How the texels of a chart follow each other. Charts follow by the nearest, except with `Greedy`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Strategy {
    /// Squares of 8 by 8 texels, each along a Hilbert curve. What a block holds is compact in both directions.
    #[default]
    Tiles,
    /// Along the border of what is left, inwards.
    Spiral,
    /// Row by row, there and back.
    ZigZag,
    /// Always to the nearest place that is left, whatever its chart.
    Greedy,
}

impl Strategy {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Tiles, Self::Spiral, Self::ZigZag, Self::Greedy];
}

impl fmt::Display for Strategy {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(match self {
            Self::Tiles => "tiles",
            Self::Spiral => "spiral",
            Self::ZigZag => "zigzag",
            Self::Greedy => "greedy",
        })
    }
}

impl FromStr for Strategy {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|strategy| strategy.to_string() == name).ok_or_else(|| {
            let names = Self::ALL.map(|strategy| strategy.to_string()).join(", ");
            format!("strategy `{name}`: one of {names}")
        })
    }
}

/// The texels by blocks of at most 64, as indices into the atlas' texels.
pub fn blocks(atlas: &Atlas, strategy: Strategy) -> Vec<Vec<u32>> {
    if strategy == Strategy::Greedy {
        return order::greedy(atlas).chunks(LANES).map(<[u32]>::to_vec).collect();
    }
    let mut blocks: Vec<Vec<u32>> = vec![Vec::new()];
    for chart in charts_by_nearness(atlas) {
        let groups = match strategy {
            Strategy::Tiles => order::tiles(atlas, &chart),
            Strategy::ZigZag => order::zigzag(atlas, &chart).chunks(LANES).map(<[u32]>::to_vec).collect(),
            _ => order::spiral(atlas, &chart).chunks(LANES).map(<[u32]>::to_vec).collect(),
        };
        for group in groups {
            match blocks.last_mut() {
                Some(last) if last.len() + group.len() <= LANES => last.extend(group),
                _ => blocks.push(group),
            }
        }
    }
    blocks
}

/// The texels of each chart; each chart is the nearest one left to the one before.
fn charts_by_nearness(atlas: &Atlas) -> Vec<Vec<u32>> {
    let mut charts: Vec<Vec<u32>> = vec![Vec::new(); atlas.charts as usize];
    for (index, texel) in (0..).zip(&atlas.texels) {
        charts[texel.texel.chart as usize].push(index);
    }
    charts.retain(|chart| !chart.is_empty());
    let at = |index: u32| Vec3::from(atlas.texels[index as usize].texel.position);
    let boxes: Vec<(Vec3, Vec3)> = charts
        .iter()
        .map(|chart| {
            chart.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), &i| (min.min(at(i)), max.max(at(i))))
        })
        .collect();
    let apart = |a: usize, b: usize| {
        let gap = (boxes[a].0 - boxes[b].1).max(boxes[b].0 - boxes[a].1).max(Vec3::ZERO);
        let middles = (boxes[a].0 + boxes[a].1) - (boxes[b].0 + boxes[b].1);
        (gap.length_squared(), middles.length_squared())
    };
    let mut left: Vec<usize> = (1..charts.len()).collect();
    let mut sequence = vec![0];
    let mut last = 0;
    while !left.is_empty() {
        let nearest = (0..left.len()).min_by(|&a, &b| {
            let (a, b) = (apart(last, left[a]), apart(last, left[b]));
            a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        last = left.remove(nearest.unwrap_or(0));
        sequence.push(last);
    }
    sequence.into_iter().map(|chart| std::mem::take(&mut charts[chart])).collect()
}
