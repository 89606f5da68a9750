//! The one table behind views, names and fields.

/// Defines the view of an object: what its members are called in Rust and in 2.x, and what each should be. A member that only
/// later versions have is marked `later`; whole objects that are new are not, since what holds them is. A member that is marked
/// `apart` behind its name is for people, or changes all the time: it does not count for `essence`.
///
/// With `message` in front it is the view of a topic: it has a header, too.
macro_rules! view {
    (
        $(#[$doc:meta])*
        message $name:ident as $object:literal {
            $( $(#[$about:meta])* $field:ident: $type:ty = $($later:ident)? $wire:literal $($apart:ident)? ),* $(,)?
        }
    ) => {
        $(#[$doc])*
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $name {
            /// What every message begins with.
            pub header: $crate::Header,
            $( $(#[$about])* pub $field: $crate::Member<$type>, )*
            /// The fingerprint of all of it.
            pub print: $crate::Print,
            /// The fingerprint of all but headerId and timestamp: the same for a message that is sent again.
            pub content: $crate::Print,
            /// The fingerprint without the header and without what changes all the time: position, velocity, battery.
            pub essence: $crate::Print,
            pub(crate) odd: Option<Box<$crate::Json>>,
        }

        view! { @shape $name $object { $( $(#[$about])* $field: $type = $($later)? $wire $($apart)? ),* } {
            fn header_mut(&mut self) -> Option<&mut $crate::Header> {
                Some(&mut self.header)
            }

            fn set_content(&mut self, content: $crate::Print) {
                self.content = content;
            }
        } }
    };
    (
        $(#[$doc:meta])*
        $name:ident as $object:literal {
            $( $(#[$about:meta])* $field:ident: $type:ty = $($later:ident)? $wire:literal $($apart:ident)? ),* $(,)?
        }
    ) => {
        $(#[$doc])*
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $name {
            $( $(#[$about])* pub $field: $crate::Member<$type>, )*
            /// The fingerprint of all of it.
            pub print: $crate::Print,
            /// The fingerprint without descriptions for people.
            pub essence: $crate::Print,
            pub(crate) odd: Option<Box<$crate::Json>>,
        }

        view! { @shape $name $object { $( $(#[$about])* $field: $type = $($later)? $wire $($apart)? ),* } {} }
    };
    (
        @shape $name:ident $object:literal {
            $( $(#[$about:meta])* $field:ident: $type:ty = $($later:ident)? $wire:literal $($apart:ident)? ),*
        } { $($further:tt)* }
    ) => {
        #[allow(non_upper_case_globals, reason = "a field goes by the name it has in the struct")]
        impl $name {
            $(
                $(#[$about])*
                pub const $field: $crate::Field = $crate::Field::new($crate::Object::$name, Self::SHAPE, $wire);
            )*

            pub(crate) const SHAPE: &'static $crate::names::Shape = &$crate::names::Shape {
                name: $object,
                members: &[$( $crate::names::Entry {
                    wire: $wire,
                    later: view!(@has $($later)?),
                    apart: view!(@has $($apart)?),
                    holds: <$type as $crate::read::Readable>::HOLDS,
                } ),*],
            };

            /// How a member is there; absent when it is one of another object.
            #[must_use]
            pub fn presence(&self, field: $crate::Field) -> $crate::Presence {
                $(
                    if field == Self::$field {
                        return self.$field.presence();
                    }
                )*
                // A view without members needs none.
                let _ = field;
                $crate::Presence::Absent
            }

            /// Whether it is a JSON object at all. Anything else has no members.
            #[must_use]
            pub const fn is_object(&self) -> bool {
                self.odd.is_none()
            }

            /// What stands there instead of an object.
            #[must_use]
            pub fn odd(&self) -> Option<&$crate::Json> {
                self.odd.as_deref()
            }
        }

        #[allow(non_camel_case_types, non_upper_case_globals, reason = "a field goes by the name it has in the struct")]
        impl $crate::read::View for $name {
            const OBJECT: $crate::Object = $crate::Object::$name;

            fn read_member<'de, D: serde::Deserializer<'de>>(
                &mut self,
                index: u8,
                reader: &$crate::read::Reader<'_>,
                deserializer: D,
            ) -> Result<$crate::Print, D::Error> {
                enum At { $( $field, )* None }
                $( const $field: u8 = At::$field as u8; )*
                const NONE: u8 = At::None as u8;
                // A view without members needs none.
                let _ = reader;
                match index {
                    $( $field => $crate::read::member(&mut self.$field, reader, deserializer), )*
                    NONE.. => $crate::read::skip(deserializer),
                }
            }

            fn seal(&mut self, print: $crate::Print, essence: $crate::Print, odd: Option<Box<$crate::Json>>) {
                self.print = print;
                self.essence = essence;
                self.odd = odd;
            }

            $($further)*
        }

        impl $crate::read::Readable for $name {
            const HOLDS: Option<$crate::Object> = Some($crate::Object::$name);

            fn read_object<'de, A: serde::de::MapAccess<'de>>(
                slot: &mut $crate::Member<Self>,
                object: A,
                reader: &$crate::read::Reader<'_>,
            ) -> Result<$crate::Print, A::Error> {
                $crate::read::plain(slot, object, reader)
            }
        }

        impl $crate::read::Readable for Box<$name> {
            const HOLDS: Option<$crate::Object> = Some($crate::Object::$name);

            fn read_object<'de, A: serde::de::MapAccess<'de>>(
                slot: &mut $crate::Member<Self>,
                object: A,
                reader: &$crate::read::Reader<'_>,
            ) -> Result<$crate::Print, A::Error> {
                $crate::read::boxed(slot, object, reader)
            }
        }
    };
    (@has) => { false };
    (@has $mark:ident) => { true };
}
