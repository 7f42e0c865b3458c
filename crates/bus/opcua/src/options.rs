//! The options of the two OPC UA buses in a driver.cfg.

use std::collections::{BTreeMap, HashMap};

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Table, Value, did_you_mean, shown};
use tickbus_fieldbus::tcp::Writers;
use tickbus_fieldbus::{At, OBSERVES, Role};
use tickbus_image::signal::{Signal, SignalTable, Station};
use tickbus_net::{Address, Host};

use super::identity::{Identity, read_identity};
use super::namespaces::{read_namespaces, read_nodesets};
use super::security::{Credentials, Keys, Mode, Policy};
use super::{NodeName, Pattern, Url};

/// The longest `write_to`, in characters.
pub(crate) const IDENTITY_LIMIT: usize = 1000;

/// The keys of which a server has one: someone can log in.
pub(crate) const LOGINS: [&str; 2] = ["user", "anonymous"];

/// The shortest publishing and sampling interval: servers count both in milliseconds.
const SHORTEST: Nanos = Nanos::from_millis(1);

/// The default address of a server: reachable only from this machine.
const ADDRESS: Address = Address::local(super::url::PORT);

/// The options of a client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClientOptions {
    /// The server.
    pub url: Url,
    /// The protection of messages.
    pub security: Policy,
    /// Certificates and login.
    pub credentials: Credentials,
    /// How often the server reports changes; `None` leaves it to the cycle. At least 1 ms.
    pub publishing_interval: Option<Nanos>,
    /// How often the server samples values; `None` leaves it to the publishing interval.
    pub sampling_interval: Option<Nanos>,
    /// The nodes of signals with their own node id, by the signals' names.
    pub nodes: BTreeMap<String, Node>,
    /// The pattern for the node ids of all other signals.
    pub node_pattern: Pattern,
    /// The identity of the only server that may be written to.
    pub write_to: Option<String>,
    /// The offset of the table in the text.
    at: usize,
}

/// The node of one signal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    /// The name.
    pub name: NodeName,
    /// The steps to an element or a member of the node's value, as written behind a number; empty for all of it.
    pub(super) member: String,
    /// The offset in the text.
    pub(super) at: usize,
}

impl Node {
    /// A node whose value is one signal.
    pub(super) const fn whole(name: NodeName, at: usize) -> Self {
        Self {
            name,
            member: String::new(),
            at,
        }
    }
}

/// The options of a server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServerOptions {
    /// The address to listen on; with port 0 the system chooses one.
    pub address: Address,
    /// The host name announced to clients; `None` for the address to listen on, or the computer's name.
    pub host: Option<String>,
    /// The permitted protections of messages; never empty.
    pub security: Vec<Policy>,
    /// Certificates, and the user that may log in.
    pub credentials: Credentials,
    /// True if anonymous logins are permitted.
    pub anonymous: bool,
    /// True if a client may not write data that another client has written recently.
    pub is_single_writer: bool,
    /// The nodes of the signals, by the signals' names: the lines of `[fieldbus.at]`.
    pub nodes: BTreeMap<String, Node>,
    /// The URIs of the device's namespaces, from number 2 on.
    pub namespaces: Vec<String>,
    /// The `NodeSet2` files with the maker's address space, each after those that it requires.
    pub nodesets: Vec<String>,
    /// The offset of the key `nodeset`, if stated.
    pub(super) nodeset_at: Option<usize>,
    /// The offset of the key `namespaces`, if stated.
    pub(super) namespaces_at: Option<usize>,
    /// How the server names itself.
    pub identity: Identity,
    pub(super) role: Role,
    /// The offset of the `[fieldbus]` table in the text, for mistakes.
    pub(super) at: usize,
}

impl ClientOptions {
    /// Replaces the address of the driver.cfg, by a URL or `HOST:PORT`.
    ///
    /// # Errors
    ///
    /// The text is neither.
    pub fn set_address(&mut self, address: &str) -> Result<(), Mistake> {
        if address.contains("://") {
            self.url = address.parse()?;
            return Ok(());
        }
        let parsed: Address = address.parse()?;
        parsed.check_dialled()?;
        self.url.address = parsed;
        Ok(())
    }

    /// Reads the keys of a client. `moved` says that [`set_address`](Self::set_address) follows.
    pub fn read(moved: bool, table: &mut Table<'_>) -> Option<Self> {
        let right = "write where the server is, such as url = \"opc.tcp://192.168.0.1:4840\"";
        let url = if moved {
            table.take("url")
        } else {
            table.require("url", right)
        };
        let at = table.at();
        let keys = Keys::take(table);
        let intervals = ["publishing_interval", "sampling_interval"].map(|key| table.take(key));
        let nodes = table.take("nodes");
        let pattern = table.take("node_pattern");
        let write_to = table.take("write_to");

        let url = match &url {
            None => moved.then(|| Url {
                address: ADDRESS,
                path: String::new(),
            }),
            Some(value) => value.text(right).and_then(|text| {
                let parsed = text.parse();
                parsed.map_err(|mistake| value.refuse(mistake)).ok()
            }),
        };
        let security = match &keys.security {
            None => Some(Policy::Basic256Sha256),
            Some(value) => value.choice("security policies", &Policy::NAMES),
        };
        let credentials = keys.read();
        let [publishing, sampling] = intervals.map(|value| match value {
            None => Some(None),
            Some(value) => interval(&value).map(Some),
        });
        let nodes = nodes.map_or(Some(BTreeMap::new()), |value| read_nodes(&value));
        let node_pattern = pattern.map_or(Some(Pattern::default()), |value| read_pattern(&value));
        let write_to = match write_to {
            None => Some(None),
            Some(value) => {
                let right =
                    "write the identity that the statistics show, or remove it to stay read-only";
                let text = value.label(IDENTITY_LIMIT, right);
                text.map(|text| Some(text.to_owned()))
            }
        };
        Some(Self {
            url: url?,
            security: security?,
            credentials: credentials?,
            publishing_interval: publishing?,
            sampling_interval: sampling?,
            nodes: nodes?,
            node_pattern: node_pattern?,
            write_to: write_to?,
            at,
        })
    }
}

impl ClientOptions {
    /// The options as text for people.
    pub fn summary(&self, role: Role) -> Vec<String> {
        let mut parts = vec![format!("connects to {}", self.url)];
        parts.push(protection(&[self.security], self.credentials.mode));
        parts.push(match &self.credentials.login {
            Some(login) => format!("as user \"{}\"", shown(&login.user)),
            None => "as nobody".to_owned(),
        });
        let pattern = shown(&self.node_pattern.0);
        parts.push(match self.nodes.len() {
            0 => format!("nodes {pattern}"),
            others => format!("nodes {pattern} but for {others}"),
        });
        parts.push(match &self.write_to {
            _ if role == Role::Observer => OBSERVES.to_owned(),
            Some(identity) => format!("writes into \"{}\" alone", shown(identity)),
            None => "writes nothing".to_owned(),
        });
        parts
    }

    /// The node of a signal of `station`.
    ///
    /// # Errors
    ///
    /// The pattern and its name do not give a node id.
    pub(super) fn node(&self, signal: &Signal, station: &Station) -> Result<NodeName, Mistake> {
        if let Some(node) = self.nodes.get(&signal.name) {
            return Ok(node.name.clone());
        }
        self.node_pattern.node(&signal.name, &station.name)
    }

    /// The node of a signal of `station` as text.
    pub fn place(&self, signal: &Signal, station: &Station) -> String {
        // An invalid node id was reported earlier.
        let node = self.node(signal, station);
        node.map_or_else(|_| String::new(), |node| shown(&node.to_string()))
    }

    /// Takes the lines of `[fieldbus.at]`, which are node ids, and reports invalid ones.
    pub fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        for line in lines {
            let name = &table.signals[line.signal].name;
            match line.text.parse() {
                Err(mistake) => line.refuse(mistake),
                Ok(_) if self.nodes.contains_key(name) => line.wrong(
                    format!("the signal \"{}\" stands in \"nodes\", too", shown(name)),
                    "keep the line in [fieldbus.at], and remove the one in nodes",
                ),
                Ok(node) => {
                    let at = line.at();
                    self.nodes.insert(name.clone(), Node::whole(node, at));
                }
            }
        }
    }

    /// Reports nodes for signals that do not exist, and nodes shared by several signals.
    pub fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        let names: Vec<&str> = table.signals.iter().map(|signal| &*signal.name).collect();
        for (name, node) in &self.nodes {
            if !names.contains(&&**name) {
                collector.report(
                    node.at,
                    format!("no signal is called \"{}\"", shown(name)),
                    did_you_mean(name, "signals", &names),
                );
            }
        }
        let mut taken: HashMap<NodeName, &str> = HashMap::new();
        for signal in &table.signals {
            let at = self.nodes.get(&signal.name).map_or(self.at, |node| node.at);
            match self.node(signal, &table.stations[signal.station]) {
                Err(error) => {
                    let what = format!("signal \"{}\": {}", shown(&signal.name), error.what);
                    collector.report(at, what, error.right);
                }
                Ok(node) => {
                    if let Some(other) = taken.insert(node.clone(), &signal.name) {
                        collector.report(
                            at,
                            format!(
                                "the signals \"{}\" and \"{}\" are both the node {}",
                                shown(other),
                                shown(&signal.name),
                                shown(&node.to_string())
                            ),
                            "give each signal a node of its own, in [fieldbus.at] or by {name} in node_pattern",
                        );
                    }
                }
            }
        }
    }
}

impl ServerOptions {
    /// Replaces the address of the driver.cfg.
    ///
    /// # Errors
    ///
    /// The text is not an address.
    pub fn set_address(&mut self, address: &str) -> Result<(), Mistake> {
        self.address = address.parse()?;
        Ok(())
    }

    /// The options as text for people.
    pub fn summary(&self) -> Vec<String> {
        let mut parts = vec![format!("listens on {}", self.address)];
        if let Some(host) = &self.host {
            parts.push(format!("announces \"{}\"", shown(host)));
        }
        parts.push(protection(&self.security, self.credentials.mode));
        let user = self.credentials.login.as_ref();
        parts.push(match (user, self.anonymous) {
            (_, true) => "for everybody".to_owned(),
            (Some(login), false) => format!("for user \"{}\"", shown(&login.user)),
            (None, false) => "for nobody".to_owned(),
        });
        match (&self.nodesets[..], self.nodes.is_empty()) {
            ([], true) => {}
            ([], false) => parts.push("has the nodes of [fieldbus.at]".to_owned()),
            (files, _) => parts.push(format!("has the nodes of {}", shown(&files.join(", ")))),
        }
        parts
    }

    /// Reads the keys of a server, for the end with `role`.
    pub fn read(role: Role, table: &mut Table<'_>) -> Option<Self> {
        let address = table.take("address");
        let host = table.take("host");
        let keys = Keys::take(table);
        let anonymous = table.take("anonymous");
        let namespaces = table.take("namespaces");
        let nodeset = table.take("nodeset");
        let identity = table.take("identity");
        let at = table.at();
        let is_single_writer = Writers::read(table);
        if !keys.has_user() && anonymous.is_none() {
            table.require_one_of(
                &LOGINS,
                "name the user that may log in, with password_file or password_env, or write \
                 anonymous = true to let everybody in",
            );
        }
        let whole = table.is_whole();

        let read = address.as_ref().map_or(Some(ADDRESS), Address::read);
        let host = host.map_or(Some(None), |value| read_host(&value).map(Some));
        let security = keys
            .security
            .as_ref()
            .map_or_else(|| Some(Policy::SECURE.to_vec()), read_policies);
        let credentials = keys.read();
        let namespaces_at = namespaces.as_ref().map(Value::at);
        let namespaces = namespaces.as_ref();
        let namespaces = namespaces.map_or(Some(Vec::new()), read_namespaces);
        let nodeset_at = nodeset.as_ref().map(Value::at);
        let nodesets = nodeset.as_ref().map_or(Some(Vec::new()), read_nodesets);
        let identity = identity.as_ref();
        let identity = identity.map_or(Some(Identity::default()), read_identity);
        let allowed = anonymous.as_ref().map_or(Some(false), Value::boolean);
        if let (Some(value), Some(false)) = (&anonymous, allowed)
            && whole
            && !keys.has_user()
        {
            value.wrong(
                "nobody may log in",
                "name a user with password_file or password_env, or write anonymous = true",
            );
        }
        Some(Self {
            address: read?,
            host: host?,
            security: security?,
            credentials: credentials?,
            anonymous: allowed?,
            is_single_writer: is_single_writer?,
            nodes: BTreeMap::new(),
            namespaces: namespaces?,
            nodesets: nodesets?,
            nodeset_at,
            namespaces_at,
            identity: identity?,
            role,
            at,
        })
    }
}

/// A host in the notation of URLs: brackets around an IPv6 address.
fn read_host(value: &Value<'_>) -> Option<String> {
    let right = "write this computer's address, such as \"192.168.0.5\", or a name that every client can look up";
    let text = value.text(right)?;
    // The text with a port appended must be an address.
    match format!("{text}:{}", super::url::PORT).parse::<Address>() {
        Ok(Address {
            host: Host::Ip(ip), ..
        }) if ip.is_unspecified() => {
            value.wrong(format!("nobody can go to the host \"{ip}\""), right);
            None
        }
        Ok(_) => Some(text.to_owned()),
        Err(_) => {
            value.wrong(format!("\"{}\" is no host", shown(text)), right);
            None
        }
    }
}

/// The required or permitted protection of messages, as text.
fn protection(policies: &[Policy], mode: Mode) -> String {
    let names: Vec<String> = (policies.iter())
        .map(|policy| match policy {
            Policy::None => "unprotected".to_owned(),
            policy => format!("{} {}", policy.name(), mode.name()),
        })
        .collect();
    names.join(" or ")
}

fn interval(value: &Value<'_>) -> Option<Nanos> {
    let span = value.duration()?;
    if span < SHORTEST {
        value.wrong(
            format!("{span} is shorter than OPC UA servers can count"),
            format!("write at least \"{SHORTEST}\""),
        );
        return None;
    }
    Some(span)
}

/// One policy, or a list of them.
fn read_policies(value: &Value<'_>) -> Option<Vec<Policy>> {
    let choose = |value: &Value<'_>| value.choice("security policies", &Policy::NAMES);
    if value.as_text().is_some() {
        return choose(value).map(|policy| vec![policy]);
    }
    let list = value.list("write a list of policies, such as [\"Basic256Sha256\"]")?;
    if list.is_empty() {
        value.wrong(
            "\"security\" names no policy, so nobody could connect",
            "name at least one; \"None\" is the one without protection",
        );
        return None;
    }
    let read: Vec<Option<Policy>> = list.iter().map(choose).collect();
    let mut read: Vec<Policy> = read.into_iter().collect::<Option<_>>()?;
    let named = read.len();
    read.sort_by_key(|policy| policy.name());
    read.dedup();
    if read.len() < named {
        value.wrong("\"security\" names a policy twice", "name each once");
        return None;
    }
    Some(read)
}

fn read_nodes(value: &Value<'_>) -> Option<BTreeMap<String, Node>> {
    let right = "write them as { \"name of a signal\" = \"ns=3;s=…\" }";
    let table = value.table("nodes", right)?;
    let mut nodes = BTreeMap::new();
    let mut sound = true;
    for (name, value) in table.all() {
        let node = value.text("write a node id in quotes, such as \"ns=2;s=Motor.Speed\"");
        let node: Option<NodeName> = node.and_then(|text| {
            let parsed = text.parse();
            parsed.map_err(|mistake| value.refuse(mistake)).ok()
        });
        match node {
            Some(node) => {
                let at = value.at();
                nodes.insert(name.to_owned(), Node::whole(node, at));
            }
            None => sound = false,
        }
    }
    sound.then_some(nodes)
}

fn read_pattern(value: &Value<'_>) -> Option<Pattern> {
    let text = value.text("write a node id with {name} in it, such as \"ns=2;s={name}\"")?;
    let pattern = Pattern(text.to_owned());
    if !text.contains(Pattern::NAME) {
        value.wrong(
            format!("the pattern \"{}\" has no {}", shown(text), Pattern::NAME),
            "write {name} where the name of the signal belongs, and {station} for that of its station",
        );
        return None;
    }
    // With a plain name, a mistake can only be the pattern's.
    if let Err(mistake) = pattern.node("name", "station") {
        value.refuse(mistake);
        return None;
    }
    Some(pattern)
}
