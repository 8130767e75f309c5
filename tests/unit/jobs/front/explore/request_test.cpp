// HTTP requests: parsing, byte ranges.
#include "jobs/front/explore/request.hpp"

#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <vector>

namespace {

using carillon::explore::FileRequest;
using carillon::explore::find_part;
using carillon::explore::parse_request;
using carillon::explore::Part;

TEST(Requests, AreReadByLine) {
  const FileRequest request = parse_request("GET /a%20b.js?x=1#y HTTP/1.1\r\nHost:  localhost:80 \r\nrange: bytes=1-2\r\nX: \r\n");
  EXPECT_EQ(request.status, 200);
  EXPECT_EQ(request.path, "/a b.js");
  EXPECT_EQ(request.host, "localhost:80");
  EXPECT_EQ(request.range, "bytes=1-2");
  EXPECT_TRUE(request.is_reusable);
  EXPECT_FALSE(request.is_head);
  EXPECT_TRUE(parse_request("HEAD / HTTP/1.1\nHost: a\n").is_head);
}

TEST(Requests, ThatCannotBeServedSayWhy) {
  const std::vector<std::pair<std::string, int>> cases{{"POST / HTTP/1.1\r\n", 405},
                                                       {"GET / HTTP/2\r\n", 505},
                                                       {"GET /\r\n", 400},
                                                       {"GET http://a/ HTTP/1.1\r\n", 400},
                                                       {"GET /%00 HTTP/1.1\r\n", 400},
                                                       {"GET /%zz HTTP/1.1\r\n", 400},
                                                       {"GET /%4 HTTP/1.1\r\n", 400},
                                                       {"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n", 400},
                                                       {"GET / HTTP/1.1\r\nHost : a\r\n", 400},
                                                       {"GET / HTTP/1.1\r\nnothing\r\n", 400},
                                                       {"\r\n", 400},
                                                       {"", 400}};
  for (const auto& [head, status] : cases) {
    EXPECT_EQ(parse_request(head).status, status) << head;
    EXPECT_FALSE(parse_request(head).is_reusable) << head;
  }
}

TEST(Requests, ToComputeABodyAreJsonOfBoundedLength) {
  const std::string begin = "POST /recut HTTP/1.1\r\nHost: a\r\n", json = "Content-Type: Application/JSON; charset=utf-8\r\n";
  const FileRequest request = parse_request(begin + json + "Content-Length: 12\r\n");
  EXPECT_EQ(request.status, 200);
  EXPECT_TRUE(request.is_post);
  EXPECT_EQ(request.length, 12U);
  EXPECT_FALSE(request.is_reusable);
  EXPECT_EQ(parse_request(begin + json).status, 411);
  EXPECT_EQ(parse_request(begin + json + "Content-Length: x\r\n").status, 411);
  EXPECT_EQ(parse_request(begin + json + "Content-Length: 1000000\r\n").status, 413);
  EXPECT_EQ(parse_request(begin + "Content-Length: 12\r\n").status, 415);
  EXPECT_FALSE(parse_request("GET /recut HTTP/1.1\r\nHost: a\r\n").is_post);
}

TEST(Requests, WithABodyOrOfHttp10EndTheirConnection) {
  for (const char* head : {"GET / HTTP/1.0\r\n", "GET / HTTP/1.1\r\nConnection: Close\r\n", "GET / HTTP/1.1\r\nContent-Length: 5\r\n",
                           "GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n"}) {
    EXPECT_EQ(parse_request(head).status, 200) << head;
    EXPECT_FALSE(parse_request(head).is_reusable) << head;
  }
  EXPECT_TRUE(parse_request("GET / HTTP/1.1\r\nContent-Length: 0\r\n").is_reusable);
}

TEST(Requests, GetOneRangeOrTheWholeFile) {
  const auto get = [](const char* range, std::uint64_t size = 10) {
    const Part part = find_part(range, size);
    return std::tuple(part.status, part.begin, part.length);
  };
  using Got = std::tuple<int, std::uint64_t, std::uint64_t>;
  EXPECT_EQ(get("bytes=0-3"), Got(206, 0, 4));
  EXPECT_EQ(get("Bytes= 2 - "), Got(206, 2, 8));
  EXPECT_EQ(get("bytes=-3"), Got(206, 7, 3));
  EXPECT_EQ(get("bytes=-30"), Got(206, 0, 10));
  EXPECT_EQ(get("bytes=9-99"), Got(206, 9, 1));
  EXPECT_EQ(get("bytes=10-"), Got(416, 0, 0));
  EXPECT_EQ(get("bytes=-0"), Got(416, 0, 0));
  EXPECT_EQ(get("bytes=0-", 0), Got(416, 0, 0));
  EXPECT_EQ(get("bytes=-5", 0), Got(416, 0, 0));
  EXPECT_EQ(get("bytes=18446744073709551615-"), Got(416, 0, 0));
  for (const char* range : {"", "bytes=", "bytes=-", "bytes=0-1,3-4", "bytes=0-,0-,0-", "bytes=3-2", "lines=0-1", "bytes=a-b", "bytes=5",
                            "bytes=0-99999999999999999999", "bytes=--1"})
    EXPECT_EQ(get(range), Got(200, 0, 10)) << range;
}

}  // namespace
