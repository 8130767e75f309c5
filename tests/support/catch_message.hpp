// Messages of exceptions.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace carillon::tests {

/// Message of the Error thrown by `call`, empty without one; other exceptions pass.
template <typename Error, typename Call>
std::string catch_message(Call&& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// Expects that `call` throws an Error whose message holds all words.
template <typename Error, typename Call>
void expect_error(const std::vector<std::string>& words, Call&& call) {
  const std::string message = catch_message<Error>(call);
  EXPECT_FALSE(message.empty()) << "no error";
  for (const std::string& word : words) EXPECT_NE(message.find(word), std::string::npos) << "'" << word << "' is not in: " << message;
}

}  // namespace carillon::tests
