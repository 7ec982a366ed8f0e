//! What a camera asks for and is shown: budgets, cuts, views of intermediates.

mod budget;
mod cuts;
mod debug;
