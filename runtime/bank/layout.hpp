// Table of a bank's arrays, shared by reader and writer of bank files and by other containers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Array of the file and its memory.
struct Field {
  std::string name;                  // path inside the HDF5 file, "mesh/vertices"
  std::string dtype;                 // numpy notation: "<f8", "<i8", "<f4", "<i4", "<i2", "|i1", "|u1", "|S10" (text of 10 bytes)
  std::vector<std::uint64_t> shape;  // empty for a scalar
  std::string units;                 // "1" if dimensionless
  std::string meaning;
  const void* data = nullptr;
};

/// File content beyond the members of Bank, or in another form.
struct FileForm {
  std::vector<double> freq_hz;            // (m), sqrt(lambda) / 2 pi, for external readers
  std::uint8_t complete = 1;              // Bank::complete
  std::vector<std::int8_t> narrow_shape;  // (V, m, 3), Bank::shape if Bank::shape_bytes is 1 (since 1.2), else empty
  // Texts of Bank, at least one byte, possibly padded with NUL; empty if absent.
  std::string element;
  std::string mass;
  std::string provenance;
  std::string damping_law;          // since 1.1
  std::string regions;              // since 1.1, optional
  std::string proof_method;         // since 1.1, absent without a proof
  std::string supports;             // since 1.3, absent without supports
  std::string radiation_method;     // since 1.5, absent without multipoles
  std::string nonlinear_form;       // since 1.7, absent without a nonlinear energy: "rows" or "points"
  std::string parameters;           // since 1.9, absent without sensitivities
  bool has_complete_below = false;  // since 1.4: Proof::complete_below_hz is present
  // Since 2.0: output of runtime/bank/packed in place of mesh and shapes. The bank has its Packing.
  bool is_packed = false;
  std::vector<std::uint8_t> packed_surface, packed_shape, packed_order;  // order may be empty
};

/// Arrays of `bank` and `form` in the order of docs/bank-format.md, without absent ones (no proof, no error bars, version 1.0). Shapes are
/// the current sizes; `data` points into `bank` and `form`, which must outlive the table.
std::vector<Field> list_fields(const Bank& bank, const FileForm& form);

/// File content in addition to `bank`.
FileForm make_file_form(const Bank& bank);

/// Array stored in another container; `field.data` is unused.
struct FieldBytes {
  Field field;
  std::span<const std::byte> bytes;
};

/// Assembles a bank from arrays, like parse_bank() of a file with exactly these. Types, extents and bytes are untrusted. Throws InputError
/// as parse_bank() does; `name` stands for the file.
Bank assemble_bank(const std::vector<FieldBytes>& arrays, const std::string& name);

/// Oldest version (major, minor) that can represent the bank, written to the file for the sake of older readers.
std::array<int, 2> find_version(const Bank& bank, bool is_packed = false);

/// Bytes per value of `dtype`; 0 for unsupported types.
std::uint64_t find_item_bytes(const std::string& dtype);

/// Bytes of the array; the product must not overflow.
std::uint64_t calc_bytes(const Field& field);

}  // namespace carillon::bank
