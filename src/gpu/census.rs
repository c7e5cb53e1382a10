//! What was created on a device since it was opened, by kind and name: what a plan's savings are held against.

use std::collections::BTreeMap;

/// Kinds of objects that are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Graphics and compute pipelines.
    Pipeline,
    /// Buffers, wherever they live.
    Buffer,
    /// Images: render targets and textures.
    Image,
    /// Samplers, one of each kind per device.
    Sampler,
}

/// Objects of one kind and name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
    /// How many were created.
    pub count: u64,
    /// Their bytes as asked for, all levels, layers and samples included; drivers may take more. 0 for
    /// pipelines and samplers.
    pub bytes: u64,
}

/// Every object that was created, whether it still exists or not.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Census {
    entries: BTreeMap<(Kind, String), Tally>,
    calls: BTreeMap<&'static str, u64>,
}

impl Census {
    pub(super) fn add(&mut self, kind: Kind, name: &str, bytes: u64) {
        let tally = self.entries.entry((kind, name.into())).or_default();
        *tally = *tally + Tally { count: 1, bytes };
    }

    /// Counts a call that succeeded, if it is one that makes something.
    pub(super) fn add_call(&mut self, call: &'static str) {
        if call.starts_with("vkCreate") || call.starts_with("vkAllocate") {
            *self.calls.entry(call).or_default() += 1;
        }
    }

    /// How often each Vulkan call that creates or allocates something was made, by name. `vkAllocateMemory` stands for
    /// every piece of memory that a resource got, though most pieces are parts of larger blocks.
    pub fn calls(&self) -> &BTreeMap<&'static str, u64> {
        &self.calls
    }

    /// All objects of a kind.
    pub fn all(&self, kind: Kind) -> Tally {
        self.entries
            .iter()
            .filter(|((other, _), _)| *other == kind)
            .fold(Tally::default(), |sum, (_, &tally)| sum + tally)
    }

    /// Those of them called `name`.
    pub fn named(&self, kind: Kind, name: &str) -> Tally {
        self.entries.get(&(kind, name.into())).copied().unwrap_or_default()
    }

    /// Names of a kind, in order.
    pub fn names(&self, kind: Kind) -> impl Iterator<Item = &str> {
        self.entries.keys().filter(move |(other, _)| *other == kind).map(|(_, name)| name.as_str())
    }
}

impl std::ops::Add for Tally {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { count: self.count + other.count, bytes: self.bytes + other.bytes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_and_names_are_counted_apart() {
        let mut census = Census::default();
        for (kind, name, bytes) in
            [(Kind::Buffer, "a", 4), (Kind::Buffer, "b", 8), (Kind::Buffer, "a", 16), (Kind::Image, "a", 1)]
        {
            census.add(kind, name, bytes);
        }
        assert_eq!(census.all(Kind::Buffer), Tally { count: 3, bytes: 28 });
        assert_eq!(census.named(Kind::Buffer, "a"), Tally { count: 2, bytes: 20 });
        assert_eq!(census.all(Kind::Pipeline), Tally::default());
        for call in ["vkCreateImage", "vkCreateImage", "vkAllocateMemory", "vkQueueSubmit2"] {
            census.add_call(call);
        }
        assert_eq!(census.calls(), &BTreeMap::from([("vkCreateImage", 2), ("vkAllocateMemory", 1)]));
        assert_eq!(census.names(Kind::Buffer).collect::<Vec<_>>(), ["a", "b"]);
    }
}
