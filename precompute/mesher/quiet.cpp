// Silences CGAL: its handlers, and the standard error streams it writes to.
#include "precompute/mesher/quiet.hpp"

#include <CGAL/assertions.h>

#include <iostream>
#include <streambuf>

namespace carillon::mesher {
namespace {

void say_nothing(const char*, const char*, const char*, int, const char*) {}

/// Discards all characters.
class Nowhere final : public std::streambuf {
  int overflow(int c) override { return c == traits_type::eof() ? 0 : c; }
};

}  // namespace

struct Quiet::Saved {
  Nowhere nowhere;
  std::streambuf *cerr = nullptr, *clog = nullptr;
  CGAL::Failure_function warning = nullptr, error = nullptr;
  CGAL::Failure_behaviour on_warning = CGAL::CONTINUE, on_error = CGAL::THROW_EXCEPTION;
};

Quiet::Quiet() : saved_(std::make_unique<Saved>()) {
  saved_->cerr = std::cerr.rdbuf(&saved_->nowhere);
  saved_->clog = std::clog.rdbuf(&saved_->nowhere);
  saved_->warning = CGAL::set_warning_handler(say_nothing);
  saved_->error = CGAL::set_error_handler(say_nothing);
  saved_->on_warning = CGAL::set_warning_behaviour(CGAL::CONTINUE);
  saved_->on_error = CGAL::set_error_behaviour(CGAL::THROW_EXCEPTION);
}

Quiet::~Quiet() {
  CGAL::set_error_behaviour(saved_->on_error);
  CGAL::set_warning_behaviour(saved_->on_warning);
  CGAL::set_error_handler(saved_->error);
  CGAL::set_warning_handler(saved_->warning);
  std::clog.rdbuf(saved_->clog);
  std::cerr.rdbuf(saved_->cerr);
}

}  // namespace carillon::mesher
