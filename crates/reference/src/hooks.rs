//! Hook points: where the behaviour of a reference device can be changed from outside.
//!
//! [`hooks!`] takes one line for each hook point of a role and makes four things of it: a method of the trait
//! `Deviation` with the conformant default, a place in the table `Hooks` of functions with a memory, the setter that
//! fills it, and the method of the device that asks whatever is switched on.

use std::collections::BTreeMap;

/// The deviations a device has, in the order in which they were switched on.
///
/// A place is empty while the deviation that stands there is asked something.
pub(crate) struct SwitchedOn<D: ?Sized>(Vec<Option<Box<D>>>);

impl<D: ?Sized> Default for SwitchedOn<D> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<D: ?Sized> std::fmt::Debug for SwitchedOn<D> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "SwitchedOn({})", self.0.len())
    }
}

impl<D: ?Sized> SwitchedOn<D> {
    pub(crate) fn push(&mut self, deviation: Box<D>) {
        self.0.push(Some(deviation));
    }

    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// Every deviation that is not being asked something just now.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &D> {
        self.0.iter().flatten().map(Box::as_ref)
    }

    /// Takes a deviation out, so that it can be handed the whole device.
    pub(crate) fn take(&mut self, index: usize) -> Option<Box<D>> {
        self.0.get_mut(index).and_then(Option::take)
    }

    pub(crate) fn put_back(&mut self, index: usize, deviation: Box<D>) {
        if let Some(place) = self.0.get_mut(index) {
            *place = Some(deviation);
        }
    }
}

/// Memory of a deviation: one, or one for each vehicle of a fleet.
pub(crate) enum Memory<M> {
    /// One memory.
    One(M),
    /// Memories by serial number, and what each is at first.
    Each(BTreeMap<String, M>, M),
}

impl<M> Memory<M> {
    /// The memory of a vehicle.
    pub(crate) fn of(&self, vehicle: &str) -> &M {
        match self {
            Self::One(memory) => memory,
            Self::Each(memories, first) => memories.get(vehicle).unwrap_or(first),
        }
    }
}

impl<M: Clone> Memory<M> {
    /// The memory of a vehicle, to be changed.
    pub(crate) fn of_mut(&mut self, vehicle: &str) -> &mut M {
        match self {
            Self::One(memory) => memory,
            Self::Each(memories, first) => memories.entry(vehicle.to_owned()).or_insert_with(|| first.clone()),
        }
    }
}

/// Makes the trait `Deviation`, the table `Hooks` and the methods of a device of its hook points.
///
/// A line is `mut` if the deviation may change itself and the device, and `ref` if it only answers. `name of vehicle`
/// says that the memory is that of the argument `vehicle`. Behind `=` stands how the answers of several deviations are
/// joined, which is the conformant default, too: `each` (there is no answer), `all` (false if one says false),
/// `fold(usual)` (what one answers is handed to the next as `usual`), `first` (the first answer there is), or
/// `own(default)` where the device joins the answers itself.
macro_rules! hooks {
    (
        $device:ident configured by $config:ident;
        $($(#[$doc:meta])* $access:ident $name:ident $(of $vehicle:ident)? ($($arg:ident: $type:ty),*) $(-> $result:ty)? = $join:ident $(($($usual:tt)+))?;)+
    ) => {
        /// A deviation that can be switched on.
        pub(crate) type Hook = Box<dyn Deviation>;

        /// The deviations that are switched on.
        pub(crate) type SwitchedOn = crate::hooks::SwitchedOn<dyn Deviation>;

        /// A way to behave otherwise. Every default is the conformant behaviour.
        #[expect(unused_variables, reason = "the defaults leave everything as it is")]
        pub(crate) trait Deviation: Send {
            /// The device is configured.
            fn configures(&self, config: &mut $config) {}

            $(hooks! { @default $(#[$doc])* $access $name $device ($($arg: $type),*) ($($result)?) $join $(($($usual)+))? })+
        }

        /// A deviation as a table of functions, with a memory of its own.
        pub(crate) struct Hooks<M> {
            memory: Memory<M>,
            configures: Option<fn(&mut $config)>,
            $($name: Option<hooks!(@function $access $device ($($type),*) ($($result)?))>,)+
        }

        #[allow(dead_code, reason = "a role may have no deviation that takes hold at a hook point in this form")]
        impl<M> Hooks<M> {
            /// A deviation that does nothing yet.
            pub(crate) fn new(memory: Memory<M>) -> Box<Self> {
                Box::new(Self { memory, configures: None, $($name: None,)+ })
            }

            pub(crate) fn configures(mut self: Box<Self>, hook: fn(&mut $config)) -> Box<Self> {
                self.configures = Some(hook);
                self
            }

            $(pub(crate) fn $name(mut self: Box<Self>, hook: hooks!(@function $access $device ($($type),*) ($($result)?))) -> Box<Self> {
                self.$name = Some(hook);
                self
            })+
        }

        impl<M: Clone + Send> Deviation for Hooks<M> {
            fn configures(&self, config: &mut $config) {
                if let Some(hook) = self.configures {
                    hook(config);
                }
            }

            $(hooks! { @hooked $access $name (hooks!(@vehicle $($vehicle)?)) $device ($($arg: $type),*) ($($result)?) $join $(($($usual)+))? })+
        }

        impl $device {
            $(hooks! { @ask $access $name ($($arg: $type),*) ($($result)?) $join $(($($usual)+))? })+
        }
    };

    (@usual each) => { () };
    (@usual all) => { true };
    (@usual fold ($usual:expr)) => { $usual };
    (@usual first) => { None };
    (@usual own ($usual:expr)) => { $usual };

    (@vehicle) => { "" };
    (@vehicle $vehicle:ident) => { &$vehicle.config.serial_number };

    (@function mut $device:ident ($($type:ty),*) ($($result:ty)?)) => { fn(&mut M, &mut $device, $($type),*) $(-> $result)? };
    (@function ref $device:ident ($($type:ty),*) ($($result:ty)?)) => { fn(&M, &$device, $($type),*) $(-> $result)? };

    (@default $(#[$doc:meta])* mut $name:ident $device:ident ($($arg:ident: $type:ty),*) ($($result:ty)?) $($join:tt)+) => {
        $(#[$doc])*
        fn $name(&mut self, device: &mut $device, $($arg: $type),*) $(-> $result)? { hooks!(@usual $($join)+) }
    };
    (@default $(#[$doc:meta])* ref $name:ident $device:ident ($($arg:ident: $type:ty),*) ($($result:ty)?) $($join:tt)+) => {
        $(#[$doc])*
        fn $name(&self, device: &$device, $($arg: $type),*) $(-> $result)? { hooks!(@usual $($join)+) }
    };

    (@hooked mut $name:ident ($vehicle:expr) $device:ident ($($arg:ident: $type:ty),*) ($($result:ty)?) $($join:tt)+) => {
        fn $name(&mut self, device: &mut $device, $($arg: $type),*) $(-> $result)? {
            match self.$name {
                Some(hook) => hook(self.memory.of_mut($vehicle), device, $($arg),*),
                None => hooks!(@usual $($join)+),
            }
        }
    };
    (@hooked ref $name:ident ($vehicle:expr) $device:ident ($($arg:ident: $type:ty),*) ($($result:ty)?) $($join:tt)+) => {
        fn $name(&self, device: &$device, $($arg: $type),*) $(-> $result)? {
            match self.$name {
                Some(hook) => hook(self.memory.of($vehicle), device, $($arg),*),
                None => hooks!(@usual $($join)+),
            }
        }
    };

    (@ask $access:ident $name:ident ($($arg:ident: $type:ty),*) ($($result:ty)?) own $($usual:tt)+) => {};
    (@ask mut $name:ident ($($arg:ident: $type:ty),*) () each) => {
        pub(crate) fn $name(&mut self, $($arg: $type),*) {
            for index in 0..self.hooks.len() {
                if let Some(mut hook) = self.hooks.take(index) {
                    hook.$name(self, $($arg),*);
                    self.hooks.put_back(index, hook);
                }
            }
        }
    };
    (@ask mut $name:ident ($($arg:ident: $type:ty),*) ($result:ty) all) => {
        pub(crate) fn $name(&mut self, $($arg: $type),*) -> $result {
            for index in 0..self.hooks.len() {
                if let Some(mut hook) = self.hooks.take(index) {
                    let goes_on = hook.$name(self, $($arg),*);
                    self.hooks.put_back(index, hook);
                    if !goes_on {
                        return false;
                    }
                }
            }
            true
        }
    };
    (@ask mut $name:ident ($($arg:ident: $type:ty),*) ($result:ty) fold ($usual:ident)) => {
        pub(crate) fn $name(&mut self, $($arg: $type),*) -> $result {
            let mut $usual = $usual;
            for index in 0..self.hooks.len() {
                if let Some(mut hook) = self.hooks.take(index) {
                    $usual = hook.$name(self, $($arg),*);
                    self.hooks.put_back(index, hook);
                }
            }
            $usual
        }
    };
    (@ask mut $name:ident ($($arg:ident: $type:ty),*) ($result:ty) first) => {
        pub(crate) fn $name(&mut self, $($arg: $type),*) -> $result {
            for index in 0..self.hooks.len() {
                if let Some(mut hook) = self.hooks.take(index) {
                    let answer = hook.$name(self, $($arg),*);
                    self.hooks.put_back(index, hook);
                    if answer.is_some() {
                        return answer;
                    }
                }
            }
            None
        }
    };
    (@ask ref $name:ident ($($arg:ident: $type:ty),*) () each) => {
        pub(crate) fn $name(&self, $($arg: $type),*) {
            for hook in self.hooks.iter() {
                hook.$name(self, $($arg),*);
            }
        }
    };
    (@ask ref $name:ident ($($arg:ident: $type:ty),*) ($result:ty) all) => {
        pub(crate) fn $name(&self, $($arg: $type),*) -> $result {
            self.hooks.iter().all(|hook| hook.$name(self, $($arg),*))
        }
    };
    (@ask ref $name:ident ($($arg:ident: $type:ty),*) ($result:ty) fold ($usual:ident)) => {
        pub(crate) fn $name(&self, $($arg: $type),*) -> $result {
            let mut $usual = $usual;
            for hook in self.hooks.iter() {
                $usual = hook.$name(self, $($arg),*);
            }
            $usual
        }
    };
    (@ask ref $name:ident ($($arg:ident: $type:ty),*) ($result:ty) first) => {
        pub(crate) fn $name(&self, $($arg: $type),*) -> $result {
            self.hooks.iter().find_map(|hook| hook.$name(self, $($arg),*))
        }
    };
}
