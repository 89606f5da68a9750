//! The members that the messages of a topic can have, as a tree that a message is walked along.
//!
//! The elements of a list are one place: `/nodeStates/*/nodeId` is the node id of any node state. Beyond what the schema says
//! nothing is entered, so a walk is bounded by the tree and by the message.

use serde_json::Value;

use super::shape::{literals, parts};

/// So deep members lie in one another; a schema that refers to itself is cut here.
const DEPTH: usize = 16;
/// So many members a tree has.
const MEMBERS: usize = 4_096;

/// The members that the messages of a topic can have. The message itself is the first of them.
#[derive(Clone, Debug)]
pub struct MemberTree {
    nodes: Vec<MemberNode>,
}

/// One member, or the elements of a list.
#[derive(Clone, Debug, Default)]
pub struct MemberNode {
    /// Where it stands, as a JSON pointer in which `*` is any element: `/nodeStates/*/nodeId`. Empty for the message.
    pub pointer: String,
    /// Its name; `*` for elements, and empty for the message.
    pub name: String,
    /// Whether the object around it needs it.
    pub mandatory: bool,
    /// The words allowed, where only these are.
    pub words: Vec<String>,
    /// In what it stands; nothing for the message.
    pub parent: Option<usize>,
    /// What stands in it, by name.
    children: Vec<(String, usize)>,
    element: Option<usize>,
}

impl MemberTree {
    /// Reads a schema.
    pub(super) fn of(root: &Value) -> Self {
        let mut tree = Self {
            nodes: vec![MemberNode::default()],
        };
        tree.grow(root, 0, &parts(root, root), DEPTH);
        tree
    }

    /// Reads what stands below a node, of which all these parts of the schema hold.
    fn grow(&mut self, root: &Value, at: usize, here: &[&Value], depth: usize) {
        self.nodes[at].words = literals(here).unwrap_or_default();
        if depth == 0 {
            return;
        }
        let required = |name: &str| {
            let all = here.iter().filter_map(|part| part.get("required")?.as_array());
            all.flatten().any(|member| member.as_str() == Some(name))
        };
        let members = here.iter().filter_map(|part| part.get("properties")?.as_object());
        // A member that several parts speak of is one.
        let mut below: Vec<(&str, Vec<&Value>)> = Vec::new();
        for (name, schema) in members.flatten() {
            let of_member = parts(root, schema);
            match below.iter_mut().find(|(known, _)| known == name) {
                Some((_, all)) => all.extend(of_member),
                None => below.push((name, of_member)),
            }
        }
        for (name, schemas) in below {
            let Some(child) = self.add(at, name, required(name)) else {
                return;
            };
            let children = &mut self.nodes[at].children;
            let place = children.partition_point(|(known, _)| known.as_str() < name);
            children.insert(place, (name.to_owned(), child));
            self.grow(root, child, &schemas, depth - 1);
        }
        let items = here.iter().filter_map(|part| part.get("items"));
        let items: Vec<&Value> = items.flat_map(|items| parts(root, items)).collect();
        if items.is_empty() {
            return;
        }
        let Some(element) = self.add(at, "*", false) else {
            return;
        };
        self.nodes[at].element = Some(element);
        self.grow(root, element, &items, depth - 1);
    }

    fn add(&mut self, parent: usize, name: &str, mandatory: bool) -> Option<usize> {
        if self.nodes.len() >= MEMBERS {
            return None;
        }
        let level = name.replace('~', "~0").replace('/', "~1");
        self.nodes.push(MemberNode {
            pointer: format!("{}/{level}", self.nodes[parent].pointer),
            name: name.to_owned(),
            mandatory,
            parent: Some(parent),
            ..MemberNode::default()
        });
        Some(self.nodes.len() - 1)
    }

    /// All of them in the order of the schema, each behind that in which it stands; the message itself is the first.
    #[must_use]
    pub fn nodes(&self) -> &[MemberNode] {
        &self.nodes
    }

    /// The member of that name below another one.
    #[must_use]
    pub fn child(&self, at: usize, name: &str) -> Option<usize> {
        let children = &self.nodes.get(at)?.children;
        let place = children.binary_search_by(|(known, _)| known.as_str().cmp(name)).ok()?;
        Some(children[place].1)
    }

    /// The elements of a list.
    #[must_use]
    pub fn element(&self, at: usize) -> Option<usize> {
        self.nodes.get(at)?.element
    }

    /// Whether the schema says which members stand below it.
    #[must_use]
    pub fn is_object(&self, at: usize) -> bool {
        self.nodes.get(at).is_some_and(|node| !node.children.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn tree() -> MemberTree {
        MemberTree::of(&json!({
            "required": ["errors"],
            "properties": {
                "errors": { "type": "array", "items": { "$ref": "#/$defs/error" } },
                "both": { "allOf": [{ "$ref": "#/$defs/error" }, { "required": ["hint"] }] },
                "open": { "type": "object" },
                "a/b": {}
            },
            "$defs": {
                "error": {
                    "required": ["level"],
                    "properties": { "level": { "enum": ["A", "B"] }, "hint": {}, "inner": { "$ref": "#/$defs/error" } }
                }
            }
        }))
    }

    #[test]
    fn members_are_told_by_their_pointers_with_their_words_and_whether_they_are_mandatory() {
        let tree = tree();
        let all = tree.nodes().iter().map(|node| (node.pointer.as_str(), node.mandatory));
        let first: Vec<(&str, bool)> = all.take(5).collect();
        assert_eq!(
            first,
            [
                ("", false),
                ("/errors", true),
                ("/errors/*", false),
                ("/errors/*/level", true),
                ("/errors/*/hint", false)
            ]
        );
        assert_eq!(tree.nodes()[3].words, ["A", "B"]);
        let both = tree.child(0, "both").expect("a member");
        let hint = tree.child(both, "hint").expect("a member");
        assert!(tree.nodes()[hint].mandatory);
        assert!(tree.nodes().iter().any(|node| node.pointer == "/a~1b"));
        let open = tree.child(0, "open").expect("a member");
        assert!(!tree.is_object(open) && tree.is_object(both));
    }

    #[test]
    fn a_schema_that_refers_to_itself_ends() {
        let tree = tree();
        assert!(tree.nodes().len() < MEMBERS, "{}", tree.nodes().len());
        let deepest = tree.nodes().iter().map(|node| node.pointer.matches('/').count()).max();
        assert_eq!(deepest, Some(DEPTH));
    }
}
