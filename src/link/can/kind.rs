//! What kind of interface the kernel calls an interface by its number (rtnetlink, `RTM_GETLINK`).
//!
//! The folders of `/sys` may be hidden or those of another network namespace; the answer to this question is the kernel's
//! own.

use std::os::fd::AsRawFd as _;

use nix::errno::Errno;
use nix::sys::socket::{AddressFamily, MsgFlags, NetlinkAddr, SockFlag, SockProtocol, SockType, recv, sendto, socket};

/// Message kinds of `linux/rtnetlink.h`.
const NEW_LINK: u16 = 16;
const GET_LINK: u16 = 18;
/// NLM_F_REQUEST.
const REQUEST: u16 = 1;
/// Attributes of `linux/if_link.h`: what an interface is, and in it the name of its kind.
const LINK_INFO: u16 = 18;
const INFO_KIND: u16 = 1;
/// The bits of an attribute's number; the others are flags.
const NUMBER: u16 = 0x3fff;
/// Lengths of the heads of a message, of what a link says first, and of an attribute.
const MESSAGE_HEAD: usize = 16;
const LINK_HEAD: usize = 16;
const ATTRIBUTE_HEAD: usize = 4;
/// Longest answer: with all statistics an interface has about 2 kB.
const LONGEST: usize = 32 << 10;

/// The kind of an interface ("can" for each driver of a controller, "vcan", "vxcan"); `None` if it has none or the kernel does
/// not say.
///
/// # Errors
/// This process may not ask: a service or a container is often kept from sockets of this family.
pub(super) fn kind(index: u32) -> Result<Option<String>, Errno> {
    let netlink = socket(
        AddressFamily::Netlink,
        SockType::Raw,
        SockFlag::SOCK_CLOEXEC | SockFlag::SOCK_NONBLOCK,
        SockProtocol::NetlinkRoute,
    );
    let netlink = netlink?;
    let fd = netlink.as_raw_fd();
    sendto(fd, &question(index), &NetlinkAddr::new(0, 0), MsgFlags::empty())?;
    // The kernel has answered when the question was taken.
    let mut answer = vec![0; LONGEST];
    let length = recv(fd, &mut answer, MsgFlags::empty())?;
    Ok(answer.get(..length).and_then(|answer| kind_in(answer, index)))
}

fn question(index: u32) -> Vec<u8> {
    let length = (MESSAGE_HEAD + LINK_HEAD) as u32;
    let mut bytes = Vec::with_capacity(MESSAGE_HEAD + LINK_HEAD);
    bytes.extend(length.to_ne_bytes());
    bytes.extend(GET_LINK.to_ne_bytes());
    bytes.extend(REQUEST.to_ne_bytes());
    // Number of the question and of the asking program: there is one question on this socket.
    bytes.extend([0; 8]);
    // Family and type of the interface: any.
    bytes.extend([0; 4]);
    bytes.extend(index.to_ne_bytes());
    bytes.extend([0; 8]);
    bytes
}

fn kind_in(answer: &[u8], index: u32) -> Option<String> {
    let is_link = u16_at(answer, 4)? == NEW_LINK;
    let is_it = answer.get(MESSAGE_HEAD + 4..MESSAGE_HEAD + 8)? == index.to_ne_bytes();
    let info = attribute(answer.get(MESSAGE_HEAD + LINK_HEAD..)?, LINK_INFO).filter(|_| is_link && is_it)?;
    let kind = attribute(info, INFO_KIND)?;
    let text = kind.split(|byte| *byte == 0).next()?;
    Some(String::from_utf8_lossy(text).into_owned())
}

/// The content of the first attribute with this number.
fn attribute(mut bytes: &[u8], wanted: u16) -> Option<&[u8]> {
    loop {
        let length = usize::from(u16_at(bytes, 0)?);
        let number = u16_at(bytes, 2)? & NUMBER;
        let content = bytes.get(ATTRIBUTE_HEAD..length)?;
        if number == wanted {
            return Some(content);
        }
        // Attributes begin at multiples of four bytes.
        bytes = bytes.get(length.next_multiple_of(4)..)?;
    }
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_ne_bytes(bytes.get(at..at + 2)?.try_into().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute_of(number: u16, content: &[u8]) -> Vec<u8> {
        let mut bytes = ((ATTRIBUTE_HEAD + content.len()) as u16).to_ne_bytes().to_vec();
        bytes.extend(number.to_ne_bytes());
        bytes.extend(content);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    }

    fn answer(index: u32, attributes: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = question(index);
        bytes[4..6].copy_from_slice(&NEW_LINK.to_ne_bytes());
        bytes.extend(attributes.concat());
        bytes
    }

    #[test]
    fn the_kind_stands_inside_what_the_link_is() {
        // IFLA_IFNAME is 3; its length is no multiple of four.
        let name = attribute_of(3, b"vcan0\0");
        let info = attribute_of(LINK_INFO | 0x8000, &attribute_of(INFO_KIND, b"vcan\0"));
        let whole = answer(7, &[name.clone(), info]);
        assert_eq!(kind_in(&whole, 7).as_deref(), Some("vcan"));
        assert_eq!(kind_in(&whole, 8), None, "the answer is about another interface");
        assert_eq!(kind_in(&answer(7, &[name]), 7), None);
        for cut in 0..whole.len() {
            let _ = kind_in(&whole[..cut], 7);
        }
        assert_eq!(kind_in(&answer(7, &[vec![0; 8]]), 7), None, "an attribute without a length");
    }

    #[test]
    fn the_loopback_interface_has_no_kind() {
        // It is the first interface of each network namespace.
        assert_eq!(kind(1), Ok(None));
    }
}
