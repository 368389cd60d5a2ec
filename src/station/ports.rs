//! `gnc-station ports`: lists the ports that a bench could use.

use std::process::ExitCode;

use gnc_text::printable;
use serialport::{SerialPortInfo, SerialPortType};

use crate::locale::Lang;
use crate::phrases::in_language;
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
        let lang = out.wording.lang();
        let _ = out.say_as_it_is(line(&port, lang));
    }
    ExitCode::SUCCESS
}

/// What is said of a port. What an adapter says of itself is its own, whatever it reads like.
fn line(port: &SerialPortInfo, lang: Lang) -> String {
    let what = match &port.port_type {
        SerialPortType::UsbPort(usb) => {
            let part =
                |text: &Option<String>| text.as_deref().map(|text| format!(" {}", printable(text))).unwrap_or_default();
            format!(
                "USB {:04x}:{:04x}{}{}{}",
                usb.vid,
                usb.pid,
                part(&usb.manufacturer),
                part(&usb.product),
                part(&usb.serial_number)
            )
        }
        SerialPortType::PciPort => in_language("on board", lang).into_owned(),
        SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
        SerialPortType::Unknown => String::new(),
    };
    format!("{:<24}{what}", printable(&port.port_name)).trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use serialport::UsbPortInfo;

    use super::*;

    #[test]
    fn an_adapter_keeps_its_name() {
        let text = |text: &str| Some(text.to_owned());
        let usb = UsbPortInfo {
            vid: 0x0403,
            pid: 0x6001,
            serial_number: text("board: failed"),
            manufacturer: text("x  board  failed"),
            product: text("memory"),
        };
        let port = |port_type| SerialPortInfo { port_name: "/dev/ttyS0".to_owned(), port_type };
        let adapter = port(SerialPortType::UsbPort(usb));
        for lang in [Lang::En, Lang::Zh, Lang::Ru] {
            let told = line(&adapter, lang);
            assert_eq!(told, "/dev/ttyS0              USB 0403:6001 x  board  failed memory board: failed", "{lang:?}");
        }
        let on_board = |lang| line(&port(SerialPortType::PciPort), lang);
        assert_eq!(on_board(Lang::En), "/dev/ttyS0              on board");
        assert!(!on_board(Lang::Zh).contains("board") && !on_board(Lang::Ru).contains("board"));
        assert_eq!(line(&port(SerialPortType::Unknown), Lang::Zh), "/dev/ttyS0");
    }
}
