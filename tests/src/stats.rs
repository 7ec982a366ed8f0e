//! Pearson's chi-squared test.

/// Probability that counts at least as uneven as these come from the expected distribution.
///
/// Cells expected to hold fewer than 5 are pooled. Counts that come from a quasi-random sequence are more even than
/// chance, so only a value near 0 is suspicious. Wilson and Hilferty's normal approximation of the distribution.
pub fn chi_squared_p_value(counts: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(counts.len(), expected.len(), "one expectation for each cell");
    let (mut statistic, mut cells) = (0.0, 0usize);
    let (mut pooled_count, mut pooled_expected) = (0.0, 0.0);
    for (&count, &expected) in counts.iter().zip(expected) {
        if expected < 5.0 {
            pooled_count += count;
            pooled_expected += expected;
        } else {
            statistic += (count - expected).powi(2) / expected;
            cells += 1;
        }
    }
    if pooled_expected > 0.0 {
        statistic += (pooled_count - pooled_expected).powi(2) / pooled_expected;
        cells += 1;
    } else if pooled_count > 0.0 {
        return 0.0;
    }
    let freedom = cells.saturating_sub(1).max(1) as f64;
    let spread = 2.0 / (9.0 * freedom);
    let z = ((statistic / freedom).cbrt() - (1.0 - spread)) / spread.sqrt();
    upper_tail(z)
}

/// Probability that a standard normal variable exceeds `z`. Abramowitz and Stegun 26.2.17, error below 7.5e-8.
fn upper_tail(z: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * z.abs());
    let polynomial = [0.319_381_530, -0.356_563_782, 1.781_477_937, -1.821_255_978, 1.330_274_429];
    let series: f64 = polynomial.iter().rev().fold(0.0, |sum, coefficient| (sum + coefficient) * t);
    let tail = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt() * series;
    if z >= 0.0 { tail } else { 1.0 - tail }
}
