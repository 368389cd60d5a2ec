//! The station's key (Ed25519, RFC 8032). With it the station may sign the digests of each run that it closes.
//!
//! A chain of digests shows a change to a person who trusts the folder; a signature shows it to a person who has the
//! public key. Both keys are files in the form of RFC 8410, so that other programs can check signatures too:
//!
//! ```text
//! openssl pkeyutl -verify -rawin -pubin -keyform DER -inkey FILE.pub -in SHA256SUMS -sigfile SHA256SUMS.sig
//! ```

use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

use ed25519_dalek::{Signature, Signer as _, SigningKey, VerifyingKey};

use super::digest;

/// The bytes before the 32 bytes of a private key: PKCS #8 of RFC 8410.
const PRIVATE_HEAD: [u8; 16] = [0x30, 0x2e, 2, 1, 0, 0x30, 5, 6, 3, 0x2b, 0x65, 0x70, 4, 0x22, 4, 0x20];
/// The bytes before the 32 bytes of a public key: SubjectPublicKeyInfo of RFC 8410.
const PUBLIC_HEAD: [u8; 12] = [0x30, 0x2a, 0x30, 5, 6, 3, 0x2b, 0x65, 0x70, 3, 0x21, 0];
/// Number of bytes of either key.
const KEY: usize = 32;
/// Access rights of other users. A key file that other users can read is not secret.
const OF_OTHERS: u32 = 0o077;
/// What is signed to try a key out. It is no text that a run has.
const TRIAL: &[u8] = b"gnc-station: this text tries out the key of a station, and is of no run";
/// Longest file that is read: both key files are shorter.
const LONGEST: u64 = 128;

/// Why a key cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// Access to the key file failed.
    #[error("cannot {what} the key {}", gnc_text::shown_path(path))]
    File {
        /// The action: "read", "write".
        what: &'static str,
        /// The key file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// Other users have rights to the key file.
    #[error("other users may use the key {} (mode {mode:03o})", gnc_text::shown_path(path))]
    Open {
        /// The key file.
        path: PathBuf,
        /// Its access rights.
        mode: u32,
    },
    /// The key file belongs to another user.
    #[error("the key {} belongs to another user", gnc_text::shown_path(path))]
    Foreign {
        /// The key file.
        path: PathBuf,
    },
    /// The file holds the other half of a key.
    #[error("{} is the {is} half of a key, and the {wanted} half is needed", gnc_text::shown_path(path))]
    OtherHalf {
        /// The key file.
        path: PathBuf,
        /// The half that it is: "private", "public".
        is: &'static str,
        /// The half that is needed.
        wanted: &'static str,
    },
    /// The file does not hold such a key.
    #[error("{} is not a {form} Ed25519 key", gnc_text::shown_path(path))]
    NoKey {
        /// The key file.
        path: PathBuf,
        /// The expected form: "private", "public".
        form: &'static str,
    },
}

impl KeyError {
    /// What the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::File { source, .. } if source.kind() == io::ErrorKind::AlreadyExists => {
                "the station does not overwrite a key: move the old key away, and keep its public half to verify its runs"
            }
            Self::File { source, .. }
                if matches!(source.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded) =>
            {
                "make room on the disk and run again"
            }
            Self::File { what: "write", .. } => "name a file in a folder that exists and that this user may write to",
            Self::File { source, .. } => match (source.kind(), gnc_files::is_refused(source)) {
                (_, Some(gnc_files::Refused::Folder)) => "name the file of the key, not its folder",
                (_, Some(_)) => "name the file that `gnc-station records key FILE` wrote",
                (io::ErrorKind::PermissionDenied, None) => {
                    "a private key must belong to the user of the station; make a public one readable for all"
                }
                (io::ErrorKind::NotFound | io::ErrorKind::NotADirectory, None) => {
                    "check the path, and `key` under [station] in the bench file; `gnc-station records key FILE` makes FILE and FILE.pub"
                }
                _ => "check the disk on which the key lies",
            },
            Self::Open { .. } => "run `chmod 600` on the key; if other users may have read it, make a new key",
            Self::Foreign { .. } => "run the station as the key's owner, or make a new key for this user",
            Self::OtherHalf { wanted: "private", .. } => {
                "name the file without .pub, which `gnc-station records key FILE` wrote beside it"
            }
            Self::OtherHalf { .. } => {
                "name FILE.pub, which `gnc-station records key FILE` wrote beside it; give no private key away"
            }
            Self::NoKey { .. } => "name the file that `gnc-station records key FILE` wrote, or FILE.pub to verify",
        }
    }
}

/// A private key.
#[derive(Debug, Clone)]
pub struct StationKey(SigningKey);

impl StationKey {
    /// Makes a new key: the private half in a file that only its owner may use, the public half beside it, `.pub`. The public
    /// half is there first, so that no private key is without it. A key that was cut off between the two gets its name when it
    /// is made again; what an earlier end left of a key that had no public half yet is no key, and goes.
    ///
    /// # Errors
    /// [`KeyError::File`]; an existing file is never overwritten.
    pub fn create(path: &Path) -> Result<PathBuf, KeyError> {
        let (public, hidden) = (public_path(path), part_of(path));
        let hidden_public = part_of(&public);
        is_free(path)?;
        if let (Ok(half), Ok(whole)) = (Self::read(&hidden), PublicKey::read(&public))
            && half.0.verifying_key() == whole.0
        {
            place(&hidden, path)?;
            return Ok(public);
        }
        is_free(&public)?;
        for left in [&hidden, &hidden_public] {
            match std::fs::remove_file(left) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => on(Err(error), "write", left)?,
                _ => {}
            }
        }
        let mut seed = [0; KEY];
        let random = Path::new("/dev/urandom");
        on(File::open(random).and_then(|mut file| file.read_exact(&mut seed)), "read", random)?;
        let key = SigningKey::from_bytes(&seed);
        let written = write(&hidden, 0o600, &[&PRIVATE_HEAD, &seed])
            .and_then(|()| write(&hidden_public, 0o644, &[&PUBLIC_HEAD, key.verifying_key().as_bytes()]))
            .and_then(|()| place(&hidden_public, &public))
            .and_then(|()| {
                let placed = place(&hidden, path);
                if placed.is_err() {
                    let _ = std::fs::remove_file(&public);
                }
                placed
            });
        if written.is_err() {
            // The reported error is the first one.
            let _ = [hidden, hidden_public].map(std::fs::remove_file);
        }
        written.map(|()| public)
    }

    /// Reads a private key that only its owner may use.
    ///
    /// # Errors
    /// [`KeyError`].
    pub fn read(path: &Path) -> Result<Self, KeyError> {
        let file = on(gnc_files::open(path), "read", path)?;
        let meta = on(file.metadata(), "read", path)?;
        // What is no private key needs no other rights.
        let seed = behind(&PRIVATE_HEAD, file, path, "private")?;
        if meta.uid() != nix::unistd::geteuid().as_raw() {
            return Err(KeyError::Foreign { path: path.to_owned() });
        }
        if meta.mode() & OF_OTHERS != 0 {
            return Err(KeyError::Open { path: path.to_owned(), mode: meta.mode() & 0o777 });
        }
        Ok(Self(SigningKey::from_bytes(&seed)))
    }

    /// The public half.
    #[must_use]
    pub fn public(&self) -> PublicKey {
        PublicKey(self.0.verifying_key())
    }

    /// The public half that lies beside the private one, if there is one.
    ///
    /// # Errors
    /// [`KeyError`]: something lies there and is no public key.
    pub fn public_beside(path: &Path) -> Result<Option<(PathBuf, PublicKey)>, KeyError> {
        let public = public_path(path);
        if public.symlink_metadata().is_err_and(|error| error.kind() == io::ErrorKind::NotFound) {
            return Ok(None);
        }
        PublicKey::read(&public).map(|key| Some((public, key)))
    }

    /// Whether a public half proves what this key signs.
    #[must_use]
    pub fn is_proved_by(&self, public: &PublicKey) -> bool {
        public.signed(TRIAL, &self.sign(TRIAL))
    }

    /// The signature of a text.
    #[must_use]
    pub(crate) fn sign(&self, text: &[u8]) -> [u8; 64] {
        self.0.sign(text).to_bytes()
    }
}

/// The public half of a key.
#[derive(Debug, Clone)]
pub struct PublicKey(VerifyingKey);

impl PublicKey {
    /// Reads a public key.
    ///
    /// # Errors
    /// [`KeyError`].
    pub fn read(path: &Path) -> Result<Self, KeyError> {
        let bytes = behind(&PUBLIC_HEAD, on(gnc_files::open(path), "read", path)?, path, "public")?;
        let no_key = |_| KeyError::NoKey { path: path.to_owned(), form: "public" };
        Ok(Self(VerifyingKey::from_bytes(&bytes).map_err(no_key)?))
    }

    /// The digest of the file that holds this half, as `sha256sum FILE.pub` shows it: by it people compare keys.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        digest::of_bytes(&[&PUBLIC_HEAD[..], self.0.as_bytes()].concat())
    }

    /// Whether the text was signed with the private half.
    #[must_use]
    pub(crate) fn signed(&self, text: &[u8], signature: &[u8]) -> bool {
        Signature::from_slice(signature).is_ok_and(|signature| self.0.verify_strict(text, &signature).is_ok())
    }
}

fn public_path(path: &Path) -> PathBuf {
    let mut public = path.as_os_str().to_owned();
    public.push(".pub");
    public.into()
}

fn part_of(path: &Path) -> PathBuf {
    let mut part = path.as_os_str().to_owned();
    part.push(format!(".{}", gnc_files::PART));
    part.into()
}

fn is_free(path: &Path) -> Result<(), KeyError> {
    let taken = path.symlink_metadata().is_ok();
    if taken { on(Err(io::Error::from(nix::errno::Errno::EEXIST)), "write", path) } else { Ok(()) }
}

/// Gives a complete file its name, unless the name is taken, and waits until that is on disk.
fn place(part: &Path, path: &Path) -> Result<(), KeyError> {
    on(std::fs::hard_link(part, path), "write", path)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    on(std::fs::remove_file(part).and_then(|()| File::open(folder)?.sync_all()), "write", path)
}

fn write(path: &Path, mode: u32, parts: &[&[u8]]) -> Result<(), KeyError> {
    let mut file = on(OpenOptions::new().write(true).create_new(true).mode(mode).open(path), "write", path)?;
    on(file.write_all(&parts.concat()).and_then(|()| file.sync_all()), "write", path)
}

fn behind(head: &[u8], file: File, path: &Path, form: &'static str) -> Result<[u8; KEY], KeyError> {
    let mut bytes = Vec::new();
    on(file.take(LONGEST).read_to_end(&mut bytes), "read", path)?;
    let key = |head: &[u8]| bytes.strip_prefix(head).and_then(|key| key.try_into().ok());
    let other = if form == "private" { (&PUBLIC_HEAD[..], "public") } else { (&PRIVATE_HEAD[..], "private") };
    key(head).ok_or_else(|| match key(other.0) {
        Some::<[u8; KEY]>(_) => KeyError::OtherHalf { path: path.to_owned(), is: other.1, wanted: form },
        None => KeyError::NoKey { path: path.to_owned(), form },
    })
}

fn on<T>(result: io::Result<T>, what: &'static str, path: &Path) -> Result<T, KeyError> {
    result.map_err(|source| KeyError::File { what, path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A full disk is no matter of the folder.
    #[test]
    fn a_full_disk_is_told_apart_from_a_folder_that_is_wrong() {
        let hint = |kind: io::ErrorKind| {
            let error: Result<(), KeyError> = on(Err(kind.into()), "write", Path::new("station.key"));
            error.map_err(|error| error.try_this()).unwrap_err()
        };
        for full in [io::ErrorKind::StorageFull, io::ErrorKind::QuotaExceeded] {
            assert_eq!(hint(full), "make room on the disk and run again");
        }
        assert!(hint(io::ErrorKind::NotFound).starts_with("name a file in a folder that exists"));
    }

    /// RFC 8032, section 7.1, test 2: one byte.
    #[test]
    fn signatures_are_those_of_the_standard() {
        let bytes = |text: &str| -> Vec<u8> {
            (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).expect("hex")).collect()
        };
        let seed = bytes("4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb");
        let public = bytes("3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c");
        let expected = bytes(
            "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da\
             085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00",
        );
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("key");
        write(&path, 0o600, &[&PRIVATE_HEAD, &seed]).expect("a file");
        write(&public_path(&path), 0o644, &[&PUBLIC_HEAD, &public]).expect("a file");
        let signature = StationKey::read(&path).expect("a key").sign(&[0x72]);
        assert_eq!(signature.as_slice(), expected);
        let public = PublicKey::read(&public_path(&path)).expect("a key");
        assert!(public.signed(&[0x72], &signature));
        assert!(!public.signed(&[0x73], &signature) && !public.signed(&[0x72], &signature[1..]));
    }

    /// Whatever call of making a key is the last one, or fails: no private key stands under its name without its public half, and
    /// the same command makes a key afterwards.
    #[test]
    fn no_private_key_is_without_its_public_half() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("station.key");
        let public = public_path(&path);
        let is_pair = || {
            let (private, public) = (StationKey::read(&path).expect("a key"), PublicKey::read(&public).expect("a key"));
            public.signed(b"text", &private.sign(b"text"))
        };
        let names = || std::fs::read_dir(folder.path()).expect("a folder").count();
        // The public half cannot be placed.
        std::fs::create_dir(&public).expect("a folder");
        assert!(StationKey::create(&path).is_err());
        std::fs::remove_dir(&public).expect("a folder");
        std::fs::create_dir(part_of(&public)).expect("a folder");
        assert!(StationKey::create(&path).is_err());
        std::fs::remove_dir(part_of(&public)).expect("a folder");
        assert_eq!(names(), 0, "nothing is left");
        // Killed before the public half was there, and in the middle of a write.
        for left in [&b""[..], &PRIVATE_HEAD, b"torn"] {
            write(&part_of(&path), 0o600, &[left]).expect("a file");
            write(&part_of(&public), 0o644, &[left]).expect("a file");
            assert!(StationKey::create(&path).is_ok() && is_pair());
            assert_eq!(names(), 2);
            std::fs::remove_file(&path).expect("a key");
            std::fs::remove_file(&public).expect("a key");
        }
        // Killed between the two.
        StationKey::create(&path).expect("a key");
        let was = std::fs::read(&public).expect("a key");
        std::fs::rename(&path, part_of(&path)).expect("a key");
        assert!(StationKey::create(&path).is_ok() && is_pair());
        assert_eq!((std::fs::read(&public).expect("a key"), names()), (was, 2));
        // The public half of another key is never written over.
        std::fs::remove_file(&path).expect("a key");
        assert!(StationKey::create(&path).is_err());
        assert_eq!(names(), 1);
    }

    #[test]
    fn a_key_that_others_may_read_is_refused() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("station.key");
        let public = StationKey::create(&path).expect("a key");
        assert!(StationKey::read(&path).is_ok() && PublicKey::read(&public).is_ok());
        assert!(matches!(StationKey::create(&path), Err(KeyError::File { .. })), "never written over");
        let half = |read: Result<(), KeyError>| match read {
            Err(KeyError::OtherHalf { is, wanted, .. }) => (is, wanted),
            other => panic!("{other:?}"),
        };
        assert_eq!(half(StationKey::read(&public).map(drop)), ("public", "private"), "its rights are not the fault");
        assert_eq!(half(PublicKey::read(&path).map(drop)), ("private", "public"));
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o640)).expect("rights");
        let refused = StationKey::read(&path).expect_err("too open");
        assert!(
            refused.to_string().starts_with("other users may use the key ")
                && refused.to_string().ends_with(" (mode 640)"),
            "{refused}"
        );
    }
}
