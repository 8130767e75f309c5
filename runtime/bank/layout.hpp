// The arrays of a bank, as one table that the writer and the reader of bank files share, and containers of other formats.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// An array of the file and the memory that holds it.
struct Field {
  std::string name;                  // path inside the HDF5 file, "mesh/vertices"
  std::string dtype;                 // as numpy writes it: "<f8", "<i8", "<f4", "<i4", "<i2", "|i1", "|u1", "|S10" (text of 10 bytes)
  std::vector<std::uint64_t> shape;  // empty for a scalar
  std::string units;                 // "1" when dimensionless
  std::string meaning;
  const void* data = nullptr;
};

/// What a file holds in addition to the members of Bank, or in another form.
struct FileForm {
  std::vector<double> freq_hz;            // (m), sqrt(lambda) / 2 pi: for readers that do no arithmetic
  std::uint8_t complete = 1;              // Bank::complete
  std::vector<std::int8_t> narrow_shape;  // (V, m, 3), Bank::shape where Bank::shape_bytes is 1 (since 1.2); else empty
  // Texts of Bank, at least one byte long, perhaps padded with NUL; empty where the file has none.
  std::string element;
  std::string mass;
  std::string provenance;
  std::string damping_law;          // since 1.1
  std::string regions;              // since 1.1, perhaps absent
  std::string proof_method;         // since 1.1, absent without a proof
  std::string supports;             // since 1.3, absent where nothing is fixed
  std::string radiation_method;     // since 1.5, absent without multipoles
  std::string nonlinear_form;       // since 1.7, absent without a nonlinear energy: "rows" or "points"
  bool has_complete_below = false;  // since 1.4: Proof::complete_below_hz is there
  // Since 2.0: in place of mesh and shapes what runtime/bank/packed makes of them. The bank has its Packing.
  bool is_packed = false;
  std::vector<std::uint8_t> packed_surface, packed_shape, packed_order;  // order: perhaps empty
};

/// The arrays of `bank` and `form` in the order of docs/bank-format.md; those that are not there (no proof, no error bars, a file of
/// version 1.0) are left out. The sizes are those of the members at the time of the call, and `data` points into them (`bank` and `form`
/// must outlive the table).
std::vector<Field> list_fields(const Bank& bank, const FileForm& form);

/// What the file of `bank` holds in addition to it.
FileForm make_file_form(const Bank& bank);

/// An array whose bytes another container holds; `field.data` is not looked at.
struct FieldBytes {
  Field field;
  std::span<const std::byte> bytes;
};

/// The bank that arrays make: what parse_bank() gives for a file that holds them and no others. Types, extents and bytes are untrusted.
/// Throws InputError as parse_bank() does; `name` stands for the file.
Bank assemble_bank(const std::vector<FieldBytes>& arrays, const std::string& name);

/// Major and minor of the oldest version that can say what is in the bank: it is the file's, so that older readers read all that they can.
std::array<int, 2> find_version(const Bank& bank, bool is_packed = false);

/// Bytes of one value of `dtype`; 0 when it is none that banks use.
std::uint64_t find_item_bytes(const std::string& dtype);

/// Bytes of the whole array. The caller knows that it does not overflow.
std::uint64_t calc_bytes(const Field& field);

}  // namespace carillon::bank
