//! Parts of a grid of workgroups.

/// A grid of workgroups, cut into rectangles of whole rows, or of parts of one row.
pub(super) struct Bands {
    groups: [u32; 3],
    /// First workgroup in x and y that is left.
    at: [u32; 2],
}

impl Bands {
    pub(super) fn new(groups: [u32; 3]) -> Self {
        let none = groups.contains(&0);
        Self { groups, at: [0, if none { groups[1] } else { 0 }] }
    }

    pub(super) fn left(&self) -> f64 {
        let [x, y, z] = self.groups.map(f64::from);
        let [at_x, at_y] = self.at.map(f64::from);
        ((y - at_y) * x - at_x) * z
    }

    /// The first workgroup and the number of them of about `want` workgroups, at least one; some must be left.
    pub(super) fn next(&mut self, want: f64) -> ([u32; 3], [u32; 3]) {
        let [x, y, z] = self.groups;
        let [at_x, at_y] = self.at;
        let (base, columns) = ([at_x, at_y, 0], want / f64::from(z));
        let rows = (columns / f64::from(x)) as u32;
        if at_x == 0 && rows >= 1 {
            let rows = rows.min(y - at_y);
            self.at[1] += rows;
            return (base, [x, rows, z]);
        }
        let columns = (columns as u32).clamp(1, x - at_x);
        self.at = if at_x + columns == x { [0, at_y + 1] } else { [at_x + columns, at_y] };
        (base, [columns, 1, z])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn bands_cover_each_workgroup_once(
            x in 0_u32..9, y in 0_u32..9, z in 0_u32..4,
            wants in proptest::collection::vec(0.0_f64..60.0, 1..20),
        ) {
            let mut rest = Bands::new([x, y, z]);
            let mut seen = vec![0; (x * y * z) as usize];
            let mut wants = wants.iter().cycle();
            while rest.left() > 0.0 {
                let want = *wants.next().expect("endless");
                let before = rest.left();
                let (base, count) = rest.next(want);
                let size: u32 = count.iter().product();
                prop_assert!(size > 0);
                prop_assert!(f64::from(size) <= want.max(f64::from(z)));
                prop_assert_eq!(before - rest.left(), f64::from(size));
                for k in 0..count[2] {
                    for j in 0..count[1] {
                        for i in 0..count[0] {
                            let at = ((base[2] + k) * y + base[1] + j) * x + base[0] + i;
                            seen[at as usize] += 1;
                        }
                    }
                }
            }
            prop_assert!(seen.iter().all(|&n| n == 1));
        }
    }
}
