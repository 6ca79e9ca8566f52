//! The Pareto front: settings that no other beats in both time and error.

/// Indices of the (cost, error) pairs that none other equals or beats in both and beats in one, cheapest first. Pairs
/// with a NaN are never among them.
#[must_use]
pub fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|&i| !points[i].0.is_nan() && !points[i].1.is_nan()).collect();
    let key = |i: usize| points[i];
    order.sort_by(|&a, &b| key(a).0.total_cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)).then(a.cmp(&b)));
    let mut best: Option<(f64, f64)> = None;
    order.retain(|&i| {
        let on = best.is_none_or(|best| points[i].1 < best.1 || points[i] == best);
        if on {
            best = Some(points[i]);
        }
        on
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force(points: &[(f64, f64)]) -> Vec<usize> {
        let dominated =
            |p: (f64, f64)| points.iter().any(|q| q.0 <= p.0 && q.1 <= p.1 && (q.0 < p.0 || q.1 < p.1));
        (0..points.len()).filter(|&i| !dominated(points[i])).collect()
    }

    proptest! {
        /// Few values, so that ties are many.
        #[test]
        fn it_is_what_brute_force_finds(points in prop::collection::vec((0_u8..12, 0_u8..12), 0..60)) {
            let points: Vec<(f64, f64)> = points.iter().map(|&(c, e)| (c.into(), e.into())).collect();
            let found = front(&points);
            prop_assert!(found.is_sorted_by(|&a, &b| points[a].0 <= points[b].0));
            let mut sorted = found.clone();
            sorted.sort_unstable();
            prop_assert_eq!(sorted, brute_force(&points));
        }
    }

    #[test]
    fn what_was_not_measured_is_not_on_it() {
        assert_eq!(front(&[(1.0, f64::NAN), (2.0, 3.0), (f64::NAN, 0.0), (1.5, 4.0), (3.0, 3.0)]), [3, 1]);
        assert!(front(&[]).is_empty());
    }
}
