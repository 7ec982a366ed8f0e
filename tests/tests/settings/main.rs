//! What a camera asks for and is shown: every setting, budgets, cuts, views of intermediates.

mod budget;
mod cuts;
mod debug;
mod effects;
mod kernels;
