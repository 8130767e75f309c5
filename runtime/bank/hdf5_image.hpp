// HDF5 part of a bank file, built in memory. Internal to carillon::bank; only its .cpp includes hdf5.h.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/seal.hpp"

namespace carillon::bank {

/// HDF5 file in memory and the positions of the arrays of list_fields().
struct Hdf5Image {
  std::unique_ptr<void, void (*)(void*)> memory{nullptr, nullptr};
  std::span<std::byte> bytes;  // file contents; the first kSealBytes are reserved for the seal
  std::map<std::string, Extent> extents;
};

/// Lays out the arrays, and for unpacked banks the /VTKHDF views, as an HDF5 file. Not thread-safe (HDF5). SystemError if HDF5 or memory
/// fails.
Hdf5Image make_hdf5_image(const Bank& bank, const FileForm& form);

}  // namespace carillon::bank
