//! Arrays that no longer change: filled in memory, or part of a file that is mapped.
//!
//! [`Frozen`] looks like a slice and costs what a slice costs: where its items lie is found once, when it is made. What they are part of
//! lives as long as any array over it. Nothing is read when an array is made over a [`Region`]: of a mapped file only those pages are
//! loaded whose items are looked at.

use std::fmt::{self, Debug, Formatter};
use std::marker::PhantomData;
use std::ops::{Deref, Range};
use std::panic::{RefUnwindSafe, UnwindSafe};
use std::sync::Arc;

use bytemuck::Pod;
use yoke::Yoke;

/// See the module.
pub struct Frozen<T: 'static>(Yoke<&'static [T], Arc<dyn AsRef<[T]> + Send + Sync>>);

impl<T: Send + Sync> Frozen<T> {
    fn over(owner: Arc<dyn AsRef<[T]> + Send + Sync>) -> Self {
        Self(Yoke::attach_to_cart(owner, |owner| owner.as_ref()))
    }
}

impl<T: Send + Sync> From<Vec<T>> for Frozen<T> {
    fn from(items: Vec<T>) -> Self {
        Self::over(Arc::new(items))
    }
}

impl<T: Send + Sync> Default for Frozen<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T: Pod + Send + Sync> Frozen<T> {
    /// The items whose memory is `region`; none if it is no whole number of items, or they do not lie as they must in memory.
    pub fn of(region: Region) -> Option<Self> {
        bytemuck::try_cast_slice::<u8, T>(region.bytes()).ok()?;
        Some(Self::over(Arc::new(Items { region, item: PhantomData })))
    }
}

impl<T> Deref for Frozen<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        self.0.get()
    }
}

impl<T> Clone for Frozen<T> {
    /// The same memory once more.
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

/// What does not change is whole after a panic, too.
impl<T> UnwindSafe for Frozen<T> {}
impl<T> RefUnwindSafe for Frozen<T> {}

impl<T: Debug> Debug for Frozen<T> {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        (**self).fmt(f)
    }
}

impl<T: PartialEq> PartialEq for Frozen<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

/// Some bytes of a larger whole, such as a mapped file, which lives as long as they do.
#[derive(Clone)]
pub struct Region {
    whole: Arc<dyn AsRef<[u8]> + Send + Sync>,
    range: Range<usize>,
}

impl Region {
    /// The bytes of `whole` in `range`; none if they are not all there.
    pub fn new(whole: Arc<dyn AsRef<[u8]> + Send + Sync>, range: Range<usize>) -> Option<Self> {
        let bytes: &[u8] = (*whole).as_ref();
        bytes.get(range.clone())?;
        Some(Self { whole, range })
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        &(*self.whole).as_ref()[self.range.clone()]
    }
}

/// A region as items. Invariant: the cast has succeeded once.
struct Items<T> {
    region: Region,
    item: PhantomData<fn() -> T>,
}

impl<T: Pod> AsRef<[T]> for Items<T> {
    fn as_ref(&self) -> &[T] {
        bytemuck::cast_slice(self.region.bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_are_those_of_the_vector_or_of_the_region() {
        let numbers = vec![1.0_f32, 2.0, 3.0, 4.0];
        let frozen = Frozen::from(numbers.clone());
        assert_eq!((&frozen[..], &frozen.clone()[1..]), (&numbers[..], &numbers[1..]));
        let whole: Arc<Vec<u8>> = Arc::new(bytemuck::cast_slice(&numbers).to_vec());
        let region = Region::new(whole.clone(), 4..12).unwrap();
        let part = Frozen::<[u8; 4]>::of(region).unwrap();
        drop(whole);
        assert_eq!(part.iter().map(|it| f32::from_le_bytes(*it)).collect::<Vec<_>>(), [2.0, 3.0]);
        assert!(Frozen::<u64>::default().is_empty());
    }

    #[test]
    fn what_is_no_array_of_such_items_is_none() {
        let whole: Arc<Vec<u8>> = Arc::new(vec![0; 64]);
        let start = whole.as_ptr().addr().next_multiple_of(8) - whole.as_ptr().addr();
        let region = |range| Region::new(whole.clone(), range).unwrap();
        assert_eq!(Frozen::<u64>::of(region(start..start + 16)).unwrap().len(), 2);
        assert!(Frozen::<u64>::of(region(start..start + 15)).is_none(), "no whole number");
        assert!(Frozen::<u64>::of(region(start + 4..start + 12)).is_none(), "off by half an item");
        assert!(Region::new(whole.clone(), 60..65).is_none() && Region::new(whole, 70..80).is_none());
    }
}
