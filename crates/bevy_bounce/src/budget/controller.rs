//! Which share of its quality a budget leaves, from what frames cost.
//!
//! Down quickly, up slowly, and neither while the cost is a little below the budget. Costs are measured some frames late, so that a
//! change is waited out before the next; single frames cost anything, so that less follows from several that are above the budget one
//! after the other, or from the median of many, and more from the latter alone. Costs fall with the share, or less than that where a part
//! of them is fixed: a step down never takes too much, and a step up never ends above the budget.

/// Frames in a row above the budget after which there is less.
const ROW: usize = 7;
/// Frames whose median decides.
const FRAMES: usize = 63;
/// Frames after a change that may have been drawn before it.
const LATENCY: u32 = 5;
/// Of the share, what a step down leaves at least.
const MOST_DOWN: f32 = 0.7;
/// Of the share, what a step up makes of it at most.
const MOST_UP: f32 = 1.05;
/// Of the budget, what a step down aims at.
const AIM: f32 = 0.95;
/// Of the budget, what a step up aims at.
const CAUTIOUS_AIM: f32 = 0.9;
/// Of the budget, what must be left unused before there is a step up.
const ROOM: f32 = 0.82;
/// Least share.
pub(crate) const LEAST_SHARE: f32 = 1.0 / 16.0;

/// A share, and the costs measured since it changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Controller {
    /// Of what quality states, 1/16 to 1.
    pub share: f32,
    waiting: u32,
    costs: [f32; FRAMES],
    measured: usize,
}

impl Default for Controller {
    fn default() -> Self {
        Self::at(1.0)
    }
}

impl Controller {
    /// With that share, before anything is measured.
    pub fn at(share: f32) -> Self {
        let share = if share.is_finite() { share.clamp(LEAST_SHARE, 1.0) } else { 1.0 };
        Self { share, waiting: LATENCY, costs: [0.0; FRAMES], measured: 0 }
    }

    /// After another frame, whose cost and whose budget are in the same unit.
    pub fn after(mut self, cost: f32, budget: f32) -> Self {
        if self.waiting > 0 {
            return Self { waiting: self.waiting - 1, ..self };
        }
        if self.measured == FRAMES {
            self.costs.rotate_left(1);
            self.measured -= 1;
        }
        self.costs[self.measured] = cost.max(0.0);
        self.measured += 1;
        let down = |cost: f32| self.times((AIM * budget / cost).max(MOST_DOWN));
        let up = |cost: f32| self.times((CAUTIOUS_AIM * budget / cost.max(f32::MIN_POSITIVE)).min(MOST_UP));
        let row = self.last(ROW).filter(|row| row.iter().all(|cost| *cost > budget));
        match (row, self.last(FRAMES)) {
            (Some(row), _) => down(median(row)),
            (None, Some(costs)) if median(costs) > budget => down(median(costs)),
            (None, Some(costs)) if median(costs) < ROOM * budget => up(median(costs)),
            _ => self,
        }
    }

    fn times(self, factor: f32) -> Self {
        let next = Self::at(self.share * factor);
        // At either end there is nothing to wait for.
        if next.share == self.share { self } else { next }
    }

    /// Costs of that many frames, the last of those that were measured; `None` before there are.
    fn last(&self, frames: usize) -> Option<&[f32]> {
        self.measured.checked_sub(frames).map(|first| &self.costs[first..self.measured])
    }

    /// What frames cost now, in the middle; `None` before any was measured at this share.
    pub fn cost(&self) -> Option<f32> {
        self.last(self.measured.min(FRAMES)).filter(|costs| !costs.is_empty()).map(median)
    }
}

fn median(costs: &[f32]) -> f32 {
    let mut sorted = costs.to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A renderer: costs at a share of 1, a part of which is fixed, uneven by so much, and known so many frames late.
    struct Renderer {
        cost: f32,
        fixed: f32,
        noise: f32,
        late: usize,
        shares: Vec<f32>,
        random: u32,
    }

    impl Renderer {
        fn new(cost: f32, fixed: f32, noise: f32) -> Self {
            Self { cost, fixed, noise, late: 3, shares: Vec::new(), random: 1 }
        }

        fn cost_at(&self, share: f32) -> f32 {
            self.cost * (self.fixed + (1.0 - self.fixed) * share)
        }

        fn uneven(&mut self) -> f32 {
            self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            1.0 + self.noise * ((self.random >> 8) as f32 / (1 << 23) as f32 - 1.0)
        }

        /// The share after each of so many frames.
        fn run(&mut self, mut controller: Controller, budget: f32, frames: usize) -> (Controller, Vec<f32>) {
            let shares = (0..frames).map(|_| {
                self.shares.push(controller.share);
                let drawn = self.shares[self.shares.len().saturating_sub(1 + self.late)];
                let cost = self.cost_at(drawn) * self.uneven();
                controller = controller.after(cost, budget);
                controller.share
            });
            let shares = shares.collect();
            (controller, shares)
        }
    }

    fn changes(shares: &[f32]) -> usize {
        shares.windows(2).filter(|pair| pair[0] != pair[1]).count()
    }

    #[test]
    fn too_much_is_taken_back_within_a_second() {
        for (cost, fixed) in [(8.0, 0.0), (8.0, 0.2), (16.0, 0.1), (4.4, 0.5)] {
            let mut renderer = Renderer::new(cost, fixed, 0.0);
            let (controller, shares) = renderer.run(Controller::default(), 4.0, 90);
            let reached = shares.iter().position(|share| renderer.cost_at(*share) <= 4.0);
            println!("{cost} ms, {fixed} of it fixed: share {} after {reached:?} frames", controller.share);
            assert!(reached.is_some_and(|frames| frames <= 75), "{cost} {fixed}: {shares:?}");
            assert!(renderer.cost_at(controller.share) > 0.84 * 4.0, "too much was taken: {}", controller.share);
            assert!(shares.windows(2).all(|pair| pair[1] <= pair[0]), "{shares:?}");
        }
    }

    #[test]
    fn steps_are_small() {
        let (_, down) = Renderer::new(100.0, 0.0, 0.3).run(Controller::default(), 4.0, 300);
        assert!(changes(&down) > 6 && down.windows(2).all(|pair| pair[1] >= 0.699 * pair[0]), "{down:?}");
        assert_eq!(down.last(), Some(&LEAST_SHARE));
        let (_, up) = Renderer::new(4.0, 0.0, 0.3).run(Controller::at(0.1), 100.0, 6000);
        assert!(up.windows(2).all(|pair| pair[1] <= 1.051 * pair[0]), "{up:?}");
    }

    #[test]
    fn it_goes_up_slowly_and_ends_where_nothing_is_taken() {
        let mut renderer = Renderer::new(4.0, 0.3, 0.1);
        let (_, shares) = renderer.run(Controller::at(0.5), 5.0, 3000);
        let reached = shares.iter().position(|share| *share == 1.0);
        assert!(reached.is_some_and(|frames| (300..1200).contains(&frames)), "{reached:?}");
        assert_eq!(changes(&shares[reached.unwrap_or(0)..]), 0);
    }

    /// Whatever the start, it settles: over the last of many frames hardly anything changes, and on the whole the budget is held.
    #[test]
    fn it_settles_under_noise() {
        for noise in [0.0, 0.05, 0.1, 0.2] {
            for start in [0.1, 0.4, 1.0] {
                for budget in [2.0, 4.0, 6.0] {
                    let mut renderer = Renderer::new(8.0, 0.15, noise);
                    let (controller, _) = renderer.run(Controller::at(start), budget, 6000);
                    let (_, shares) = renderer.run(controller, budget, 6000);
                    let cost = renderer.cost_at(shares.iter().sum::<f32>() / shares.len() as f32);
                    println!("noise {noise}, from {start} to {budget}: {} changes, {cost}", changes(&shares));
                    assert!(changes(&shares) <= 2, "noise {noise}, {budget}: {} changes", changes(&shares));
                    assert!((0.7 * budget..=budget).contains(&cost), "noise {noise}: {cost} of {budget}");
                }
            }
        }
    }

    #[test]
    fn a_single_slow_frame_changes_nothing() {
        let mut controller = Controller::default();
        for frame in 0..400 {
            controller = controller.after(if frame % 40 == 0 { 50.0 } else { 3.0 }, 4.0);
        }
        assert_eq!(controller.share, 1.0);
    }

    #[test]
    fn nonsense_is_held_within_bounds() {
        assert_eq!((Controller::at(f32::NAN).share, Controller::at(-1.0).share), (1.0, LEAST_SHARE));
        let mut controller = Controller::default();
        for cost in [f32::NAN, f32::INFINITY, -3.0, 0.0].into_iter().cycle().take(400) {
            controller = controller.after(cost, 4.0);
            assert!((LEAST_SHARE..=1.0).contains(&controller.share));
        }
    }
}
