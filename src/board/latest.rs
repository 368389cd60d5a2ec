//! The newest value of something, for many tasks that wait for the next one.
//!
//! This works like tokio's watch channel, with one difference: waiting tasks wake in the order in which they began to
//! wait. A watch channel wakes them in random order. Then several items would do the same work in another order each
//! time, and no run could be repeated.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

#[derive(Debug)]
struct Shared<T> {
    newest: Mutex<Newest<T>>,
    changed: Notify,
}

#[derive(Debug)]
struct Newest<T> {
    value: T,
    changes: u64,
    /// The number of handles that may change the value.
    writers: usize,
}

impl<T> Shared<T> {
    fn lock(&self) -> MutexGuard<'_, Newest<T>> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until `look` finds something. A change between a look and the wait is not missed.
    async fn found<R>(&self, mut look: impl FnMut(&mut Newest<T>) -> Option<R>) -> R {
        loop {
            let mut changed = std::pin::pin!(self.changed.notified());
            changed.as_mut().enable();
            if let Some(found) = look(&mut self.lock()) {
                return found;
            }
            changed.await;
        }
    }
}

/// A handle that changes the value. Copies of the handle change the same value.
#[derive(Debug)]
pub struct Latest<T>(Arc<Shared<T>>);

impl<T> Latest<T> {
    /// The first value.
    pub fn new(value: T) -> Self {
        let newest = Mutex::new(Newest { value, changes: 0, writers: 1 });
        Self(Arc::new(Shared { newest, changed: Notify::new() }))
    }

    /// Looks at the newest value and holds its lock meanwhile.
    pub fn look<R>(&self, look: impl FnOnce(&T) -> R) -> R {
        look(&self.0.lock().value)
    }

    /// Changes the value and wakes the waiting tasks.
    pub fn change(&self, change: impl FnOnce(&mut T)) {
        let mut newest = self.0.lock();
        change(&mut newest.value);
        newest.changes += 1;
        drop(newest);
        self.0.changed.notify_waiters();
    }

    /// Waits until the value is as wanted. Returns at once if it is so already.
    pub async fn until(&self, mut come: impl FnMut(&T) -> bool) -> T
    where
        T: Clone,
    {
        self.0.found(|newest| come(&newest.value).then(|| newest.value.clone())).await
    }

    /// A follower of the changes from now on.
    pub(crate) fn follower(&self) -> Follower<T> {
        let seen = self.0.lock().changes;
        Follower { shared: Arc::clone(&self.0), seen }
    }
}

impl<T> Clone for Latest<T> {
    fn clone(&self) -> Self {
        self.0.lock().writers += 1;
        Self(Arc::clone(&self.0))
    }
}

impl<T> Drop for Latest<T> {
    fn drop(&mut self) {
        self.0.lock().writers -= 1;
        self.0.changed.notify_waiters();
    }
}

/// A follower of the changes of a value.
#[derive(Debug)]
pub struct Follower<T> {
    shared: Arc<Shared<T>>,
    seen: u64,
}

impl<T: Copy> Follower<T> {
    /// Another follower of the same value, from now on.
    #[must_use]
    pub(crate) fn another(&self) -> Self {
        let seen = self.shared.lock().changes;
        Self { shared: Arc::clone(&self.shared), seen }
    }

    /// The value as it is now.
    #[must_use]
    pub(crate) fn now(&self) -> T {
        self.shared.lock().value
    }

    /// The next change, or the newest of several; `None` when no handle can change the value any more.
    pub async fn changed(&mut self) -> Option<T> {
        let seen = self.seen;
        let (changes, value) = self
            .shared
            .found(|newest| match (newest.changes > seen, newest.writers) {
                (true, _) => Some((newest.changes, Some(newest.value))),
                (false, 0) => Some((seen, None)),
                (false, _) => None,
            })
            .await;
        self.seen = changes;
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures_util::future::{FutureExt as _, join_all};
    use std::cell::RefCell;

    #[tokio::test]
    async fn those_who_wait_are_woken_in_their_order() {
        for _ in 0..20 {
            let latest = Latest::new(0);
            let woken = RefCell::new(Vec::new());
            let wait = async |number: usize| {
                latest.until(|value| *value > 0).await;
                woken.borrow_mut().push(number);
            };
            let change = async { latest.change(|value| *value += 1) };
            tokio::join!(join_all((0..40).map(wait)), change);
            assert_eq!(*woken.borrow(), (0..40).collect::<Vec<_>>());
        }
    }

    #[tokio::test]
    async fn a_follower_sees_the_newest_change_once() {
        let latest = Latest::new(1);
        let mut follower = latest.follower();
        assert_eq!(follower.changed().now_or_never(), None, "nothing has changed yet");
        latest.change(|value| *value = 2);
        latest.clone().change(|value| *value = 3);
        let mut late = follower.another();
        assert_eq!((follower.changed().await, late.changed().now_or_never()), (Some(3), None));
        assert_eq!(follower.changed().now_or_never(), None, "it was seen");
        latest.change(|value| *value = 4);
        drop(latest);
        assert_eq!((follower.changed().await, follower.changed().await, follower.now()), (Some(4), None, 4));
    }
}
