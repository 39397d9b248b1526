//! What is new where: the passes skip what has not changed since they last looked.

use super::state::State;

/// Marks of the vertices.
#[derive(Debug, Clone, Default)]
pub(super) struct Activity {
    /// Counts the sweeps of all passes.
    clock: u32,
    /// The sweep in which a vertex last moved or got or lost an edge.
    changed: Vec<u32>,
    /// Whether smoothing should look at a vertex: its star has changed, or it has not come to rest.
    awake: Vec<bool>,
}

impl Activity {
    /// Everything is new.
    pub(super) fn new(vertices: usize) -> Self {
        Activity { clock: 0, changed: vec![0; vertices], awake: vec![true; vertices] }
    }

    /// Makes room for one more vertex.
    pub(super) fn push(&mut self) {
        self.changed.push(self.clock);
        self.awake.push(true);
    }

    /// Starts a sweep; its number is what [`Activity::is_new`] of a later sweep takes.
    pub(super) fn begin(&mut self) -> u32 {
        self.clock += 1;
        self.clock
    }

    pub(super) fn mark_changed(&mut self, v: u32) {
        self.changed[v as usize] = self.clock;
    }

    /// Whether a vertex has changed in the given sweep or later.
    #[inline]
    pub(super) fn is_new(&self, v: u32, since: u32) -> bool {
        self.changed[v as usize] >= since
    }

    pub(super) fn wake(&mut self, v: u32) {
        self.awake[v as usize] = true;
    }

    /// Whether a vertex is awake; it sleeps from now on.
    #[inline]
    pub(super) fn take_awake(&mut self, v: u32) -> bool {
        std::mem::replace(&mut self.awake[v as usize], false)
    }
}

impl State<'_> {
    /// A vertex and its neighbours are to be smoothed again.
    pub(super) fn wake_star(&mut self, v: u32) {
        self.activity.wake(v);
        self.mesh.neighbours(v).for_each(|n| self.activity.wake(n));
    }

    /// The edges of these vertices are new.
    pub(super) fn mark_connected(&mut self, vertices: &[u32]) {
        for &v in vertices {
            self.activity.mark_changed(v);
            self.activity.wake(v);
        }
    }
}
