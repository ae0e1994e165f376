// Three LS7366R counters on SPI that send a line a_b_c of docs/devices.md; chip select on pins 8, 9, 10.
#include <SPI.h>

const uint8_t SELECT[3] = {8, 9, 10};                 // shoulder, elbow, insertion
const unsigned long PERIOD_US = 10000;                // 100 Hz
const uint8_t CLEAR = 0x20, LATCH = 0xE8, READ = 0x68, MODE_0 = 0x88, MODE_1 = 0x90;
uint32_t next_us;

void begin_talk(int k) {
  SPI.beginTransaction(SPISettings(1000000, MSBFIRST, SPI_MODE0));
  digitalWrite(SELECT[k], LOW);
}

void end_talk(int k) {
  digitalWrite(SELECT[k], HIGH);
  SPI.endTransaction();
}

void tell(int k, uint8_t command) {
  begin_talk(k);
  SPI.transfer(command);
  end_talk(k);
}

void put(int k, uint8_t command, uint8_t value) {
  begin_talk(k);
  SPI.transfer(command);
  SPI.transfer(value);
  end_talk(k);
}

int32_t latched(int k) {
  uint32_t value = 0;
  begin_talk(k);
  SPI.transfer(READ);
  for (int i = 0; i < 4; i++) value = (value << 8) | SPI.transfer(0);
  end_talk(k);
  return (int32_t)value;
}

void setup() {
  Serial.begin(115200);
  SPI.begin();
  for (int k = 0; k < 3; k++) {
    pinMode(SELECT[k], OUTPUT);
    digitalWrite(SELECT[k], HIGH);
    put(k, MODE_0, 0x03);                             // four counts a cycle, free running, no index
    put(k, MODE_1, 0x00);                             // 32 bits
    tell(k, CLEAR);
  }
  next_us = micros();
}

void loop() {
  if ((int32_t)((uint32_t)micros() - next_us) < 0) return;
  next_us += PERIOD_US;
  for (int k = 0; k < 3; k++) tell(k, LATCH);
  char row[48];
  snprintf(row, sizeof row, "%ld_%ld_%ld\r\n", (long)latched(0), (long)latched(1), (long)latched(2));
  Serial.print(row);
}
