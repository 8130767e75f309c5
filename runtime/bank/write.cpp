// Atomic writing of banks: sealed in memory, then base::write_file().
#include "runtime/bank/write.hpp"

#include <fmt/format.h>

#include <cstring>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/hdf5_image.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/seal.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::bank {
namespace {

namespace fs = std::filesystem;

/// Target of the write: symbolic links are followed, only regular files are replaced.
fs::path resolve_target(const fs::path& file) {
  if (file.empty() || !file.has_filename()) throw InputError(fmt::format("\"{}\" names no file; give the bank a file name", file.string()));
  std::error_code error;
  fs::path target = fs::exists(file, error) ? fs::canonical(file, error) : file;
  const fs::file_status status = fs::status(target, error);
  if (fs::is_directory(status)) throw InputError(fmt::format("{}: is a folder; give the bank a file name inside it", file.string()));
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    throw InputError(fmt::format("{}: is not a regular file; give the bank another name", file.string()));
  }
  const fs::path folder = base::find_folder(target);
  if (!fs::is_directory(folder, error)) {
    throw InputError(fmt::format("{}: there is no folder {}; make it or choose another", file.string(), folder.string()));
  }
  return target;
}

/// Throws InputError for an invalid bank; `name` stands for it in the message.
void check_faults(const Bank& bank, const std::string& name) {
  if (bank.multipoles.is_in_decay)  // a reader would add radiation again
    throw InputError(name + ": this bank is prepared for playing in air and is not written; write the input of choose_frequencies()");
  const auto faults = find_faults(bank);
  if (faults.empty()) return;
  throw InputError(fmt::format("{}: this bank is invalid and is not written: {}{}", name, faults[0],
                               faults.size() > 1 ? fmt::format(" (and {} more)", faults.size() - 1) : ""));
}

/// Makes the sealed bytes of a valid bank and passes them to `use`.
template <typename Use>
void use_bytes(const Bank& bank, const FileForm& form, Use&& use) {
  const Hdf5Image image = make_hdf5_image(bank, form);
  const std::span<std::byte> bytes = image.bytes;
  const std::string text = format_seal_text(bytes.size(), find_version(bank, form.is_packed), image.extents);
  std::memcpy(bytes.data(), text.data(), kTextBytes);
  base::Sha256 digest;
  digest.add(bytes.first(kTextBytes));
  digest.add(bytes.subspan(kSealBytes));
  std::memcpy(bytes.data() + kTextBytes, base::to_hex(digest.finish()).data(), kDigestBytes);

  use(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

FileForm make_packed_form(const PackedBank& packed) {
  FileForm form = make_file_form(packed.bank);
  form.is_packed = true;
  form.packed_surface = packed.surface;
  form.packed_shape = packed.shape;
  form.packed_order = packed.order;
  return form;
}

}  // namespace

void write_bank(const Bank& bank, const fs::path& file) {
  check_faults(bank, file.string());
  const fs::path target = resolve_target(file);
  use_bytes(bank, make_file_form(bank), [&](std::string_view bytes) { base::write_file(target, bytes); });
}

std::string make_bank_bytes(const Bank& bank) {
  check_faults(bank, "the bank");
  std::string made;
  use_bytes(bank, make_file_form(bank), [&](std::string_view bytes) { made = bytes; });
  return made;
}

void write_packed_bank(const PackedBank& packed, const fs::path& file) {
  check_faults(packed.bank, file.string());
  const fs::path target = resolve_target(file);
  use_bytes(packed.bank, make_packed_form(packed), [&](std::string_view bytes) { base::write_file(target, bytes); });
}

std::string make_packed_bytes(const PackedBank& packed) {
  check_faults(packed.bank, "the packed bank");
  std::string made;
  use_bytes(packed.bank, make_packed_form(packed), [&](std::string_view bytes) { made = bytes; });
  return made;
}

}  // namespace carillon::bank
