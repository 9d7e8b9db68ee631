// A stand-in for the Arduino core: the clock stands still but for advance(), and Serial is a pair of strings.
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <string>

#define IRAM_ATTR
typedef unsigned char byte;
enum { INPUT, OUTPUT, RISING };
static unsigned long now_us = 1000000;
static int level[64], pwm[64];
static unsigned long millis() { return now_us / 1000; }
static unsigned long micros() { return now_us; }
static void pinMode(int, int) {}
static int digitalRead(int pin) { return level[pin]; }
static void digitalWrite(int pin, int value) { level[pin] = value; }
static void analogWrite(int pin, int value) { pwm[pin] = value; }
static int digitalPinToInterrupt(int pin) { return pin; }
static void (*handler[64])();
static void attachInterrupt(int pin, void (*call)(), int) { handler[pin] = call; }
static void noInterrupts() {}
static void interrupts() {}
template <class T> static T constrain(T value, T low, T high) { return value < low ? low : value > high ? high : value; }
struct Port {
  std::string in;
  void begin(long) {}
  int available() { return in.size(); }
  int read() { char c = in[0]; in.erase(0, 1); return c; }
  void print(const char *text) { fputs(text, stdout); }
  void print(long value) { ::printf("%ld", value); }
  void print(unsigned long value) { ::printf("%lu", value); }
  void print(int value) { ::printf("%d", value); }
  void printf(const char *format, ...) { va_list all; va_start(all, format); vprintf(format, all); va_end(all); }
};
static Port Serial;
