//! Codes that say why the board refused or failed.

use crate::wire::wire_enum;

wire_enum! {
    /// Why the board refused a request (NAK). The request was never started.
    NakCode: u16 {
        /// No HELLO since the board's start, or its watchdog ended the session.
        NoSession = 1,
        /// The message id means nothing to this firmware.
        UnknownMessage = 2,
        /// The payload does not have the layout of the message.
        BadPayload = 3,
        /// A field is outside its range.
        BadParameter = 4,
        /// Another request uses the same resource, or too many run at once.
        Busy = 5,
        /// The module is not powered.
        NotPowered = 6,
        /// The flash sector is not a scratch sector.
        Protected = 7,
        /// The stream does not fit on the link; the text shows the calculation.
        DoesNotFit = 8,
        /// The socket has no such device.
        NoDevice = 9,
        /// The module holds no valid calibration.
        NotCalibrated = 10,
    }
}

impl NakCode {
    /// What the code means, in lower case.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::NoSession => "no session with the board",
            Self::UnknownMessage => "message unknown to the board's firmware",
            Self::BadPayload => "payload not understood",
            Self::BadParameter => "parameter out of range",
            Self::Busy => "board busy",
            Self::NotPowered => "module not powered",
            Self::Protected => "flash sector protected",
            Self::DoesNotFit => "stream does not fit on the link",
            Self::NoDevice => "no such device in the socket",
            Self::NotCalibrated => "module holds no valid calibration",
        }
    }
}

wire_enum! {
    /// How an accepted request ended: the status of a RESULT.
    FaultCode: u16 {
        /// Done; the body follows.
        None = 0,
        /// Ended by ABORT or MAKE_SAFE. (The end of a session ends requests too, but without a RESULT.)
        Aborted = 1,
        /// A device of the module did not answer in its time.
        DeviceTimeout = 2,
        /// A device of the module answered with its own error.
        DeviceFault = 3,
    }
}

impl FaultCode {
    /// What the code means, in lower case.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::None => "done",
            Self::Aborted => "aborted",
            Self::DeviceTimeout => "a device of the module did not answer",
            Self::DeviceFault => "a device of the module reported an error",
        }
    }
}
