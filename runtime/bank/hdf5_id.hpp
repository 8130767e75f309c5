// RAII for HDF5 identifiers, for .cpp files that write HDF5.
#pragma once

#include <fmt/core.h>
#include <hdf5.h>

#include "runtime/base/error.hpp"

namespace carillon::bank {

/// Owner of an identifier. Throws SystemError "HDF5 cannot make WHAT" for an invalid one.
class Hdf5Id {
 public:
  Hdf5Id(hid_t id, herr_t (*close)(hid_t), const char* what = "a part of the file") : id_(id), close_(close) {
    if (id < 0) throw SystemError(fmt::format("HDF5 cannot make {}", what));
  }
  ~Hdf5Id() { close_(id_); }
  Hdf5Id(const Hdf5Id&) = delete;
  Hdf5Id& operator=(const Hdf5Id&) = delete;
  operator hid_t() const { return id_; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// Throws SystemError "HDF5 cannot WHAT" if a call failed.
inline void require(herr_t status, const char* what) {
  if (status < 0) throw SystemError(fmt::format("HDF5 cannot {}", what));
}

}  // namespace carillon::bank
