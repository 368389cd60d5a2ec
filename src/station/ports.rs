//! `gnc-station ports`: lists the ports that a bench could use.

use std::process::ExitCode;

use gnc_text::printable;
use serialport::SerialPortType;

use crate::wording::Lines;

/// Lists the serial ports of this computer.
pub(crate) fn run() -> ExitCode {
    let ports = match serialport::available_ports() {
        Ok(ports) => ports,
        Err(error) => return crate::refusal::refuse(format_args!("cannot list the serial ports: {error}"), ""),
    };
    let mut out = Lines::to_stdout();
    if ports.is_empty() {
        out.say("this computer has no serial port; plug in an adapter, or use --sim");
    }
    for port in ports {
        let what = match port.port_type {
            SerialPortType::UsbPort(usb) => {
                let part = |text: Option<String>| text.map(|text| format!(" {}", printable(&text))).unwrap_or_default();
                format!(
                    "USB {:04x}:{:04x}{}{}{}",
                    usb.vid,
                    usb.pid,
                    part(usb.manufacturer),
                    part(usb.product),
                    part(usb.serial_number)
                )
            }
            SerialPortType::PciPort => "on board".to_owned(),
            SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
            SerialPortType::Unknown => String::new(),
        };
        out.say(format_args!("{:<24}{what}", port.port_name));
    }
    ExitCode::SUCCESS
}
