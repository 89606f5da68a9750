//! `message/schema`.
