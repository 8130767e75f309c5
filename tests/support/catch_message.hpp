// Message of an exception.
#pragma once

#include <string>

namespace carillon::tests {

/// Message of the Error thrown by `call`; other exceptions pass.
template <typename Error, typename Call>
std::string catch_message(Call&& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

}  // namespace carillon::tests
