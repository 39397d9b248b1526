//! What is new where: the passes skip what has not changed since they last looked.

use super::kernel::Kernel;
use super::state::State;

/// The number of the sweep before all others: a pass that looks at what is new since then looks at all that is new at the start.
pub(super) const FIRST_SWEEP: u32 = 1;

/// Marks of the vertices.
#[derive(Debug, Clone, Default)]
pub(super) struct Activity {
    /// Counts the sweeps of all passes, from [`FIRST_SWEEP`].
    clock: u32,
    /// The sweep in which a vertex last moved or got or lost an edge.
    changed: Vec<u32>,
    /// Vertices in the order in which they changed, once for each sweep, and where the sweeps begin in it.
    journal: Vec<u32>,
    begins: Vec<usize>,
    /// Whether smoothing should look at a vertex: its star has changed, or it has not come to rest.
    awake: Vec<bool>,
}

impl Activity {
    /// Everything is new.
    pub(super) fn new(vertices: usize) -> Self {
        let journal = (0..vertices as u32).collect();
        Activity { clock: FIRST_SWEEP, changed: vec![FIRST_SWEEP; vertices], journal, begins: vec![0, 0], awake: vec![true; vertices] }
    }

    /// Only the vertices within `rings` edges of `seeds` are new.
    pub(super) fn around(mesh: &Kernel, seeds: impl Iterator<Item = u32>, rings: u32) -> Self {
        let count = mesh.vertex_slots() as usize;
        let mut activity =
            Activity { clock: FIRST_SWEEP, changed: vec![0; count], journal: Vec::new(), begins: vec![0, 0], awake: vec![false; count] };
        let mut front: Vec<u32> = seeds.collect();
        for _ in 0..=rings {
            front.retain(|&v| !std::mem::replace(&mut activity.awake[v as usize], true));
            front.iter().for_each(|&v| activity.mark_changed(v));
            front = front.iter().flat_map(|&v| mesh.neighbours(v)).collect();
        }
        activity
    }

    /// Makes room for one more vertex.
    pub(super) fn push(&mut self) {
        self.journal.push(self.changed.len() as u32);
        self.changed.push(self.clock);
        self.awake.push(true);
    }

    /// Starts a sweep; its number is what [`Activity::is_new`] of a later sweep takes.
    pub(super) fn begin(&mut self) -> u32 {
        self.clock += 1;
        self.begins.push(self.journal.len());
        self.clock
    }

    pub(super) fn mark_changed(&mut self, v: u32) {
        if std::mem::replace(&mut self.changed[v as usize], self.clock) != self.clock {
            self.journal.push(v);
        }
    }

    /// Vertices (perhaps removed since, perhaps listed twice) that have changed in the given sweep or later.
    pub(super) fn changed_since(&self, since: u32) -> &[u32] {
        &self.journal[self.begins[since as usize]..]
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
