//! Software, network and battery of the vehicle.

use crate::{Json, List, Member, Number, Text};

view! {
    /// Versions of the software and data of the network.
    VehicleConfig as "vehicleConfig" {
        /// What is installed.
        versions: List<VersionEntry> = "versions",
        /// How it is connected.
        network: Network = "network",
        /// When it charges.
        battery_charging: BatteryCharging = later "batteryCharging",
    }
}

view! {
    /// A version of some part.
    VersionEntry as "versionEntry" {
        /// The part.
        key: Text = "key",
        /// Its version.
        value: Json = "value",
    }
}

view! {
    /// Data of the network.
    Network as "network" {
        /// Servers for names.
        dns_servers: List<Member<Text>> = "dnsServers",
        /// Servers for the time.
        ntp_servers: List<Member<Text>> = "ntpServers",
        /// Its own address.
        local_ip_address: Text = "localIpAddress",
        /// The mask.
        netmask: Text = "netmask",
        /// The gateway.
        default_gateway: Text = "defaultGateway",
    }
}

view! {
    /// When the vehicle charges.
    BatteryCharging as "batteryCharging" {
        /// In percent.
        critical_low_charging_level: Number = "criticalLowChargingLevel",
        /// In percent.
        minimum_desired_charging_level: Number = "minimumDesiredChargingLevel",
        /// In percent.
        maximum_desired_charging_level: Number = "maximumDesiredChargingLevel",
        /// In seconds.
        minimum_charging_time: Number = "minimumChargingTime",
    }
}
