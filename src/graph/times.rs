use serde::Serialize;

/// What a pass took.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassTime {
    /// Its path.
    pub path: String,
    /// Milliseconds on the device, from the end of its barrier to its own end, summed over its bands. `None`
    /// where the device has no timestamps.
    pub ms: Option<f64>,
    /// Dispatches it was split into; 1 for passes that are no kernels, 0 for a kernel with nothing to do.
    pub bands: u32,
}

/// A group of passes, or one pass, and what it took.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimeNode {
    /// Last part of the path; empty for the whole graph.
    pub name: String,
    /// Milliseconds of all passes within; `None` where one was not measured.
    pub ms: Option<f64>,
    /// Its parts, in order of execution; empty for a pass.
    pub children: Vec<TimeNode>,
}

/// Sums times by path.
///
/// ```
/// use parhelion::graph::{PassTime, roll_up};
/// let pass = |path: &str, ms| PassTime { path: path.into(), ms: Some(ms), bands: 1 };
/// let tree = roll_up(&[pass("indirect/gather", 3.0), pass("indirect/upsample", 0.5), pass("compose", 0.25)]);
/// assert_eq!(tree.ms, Some(3.75));
/// assert_eq!((tree.children[0].name.as_str(), tree.children[0].ms), ("indirect", Some(3.5)));
/// ```
#[must_use]
pub fn roll_up(passes: &[PassTime]) -> TimeNode {
    let mut root = TimeNode { name: String::new(), ms: Some(0.0), children: Vec::new() };
    for pass in passes {
        let mut node = &mut root;
        node.add(pass.ms);
        for name in pass.path.split('/') {
            let place = node.children.iter().position(|child| child.name == name).unwrap_or_else(|| {
                node.children.push(TimeNode { name: name.into(), ms: Some(0.0), children: Vec::new() });
                node.children.len() - 1
            });
            node = &mut node.children[place];
            node.add(pass.ms);
        }
    }
    root
}

impl TimeNode {
    fn add(&mut self, ms: Option<f64>) {
        self.ms = self.ms.zip(ms).map(|(sum, ms)| sum + ms);
    }
}
