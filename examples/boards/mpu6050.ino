// An MPU-6050 on I2C that speaks catenary's protocol of docs/devices.md. Ranges: 2 g, 250 deg/s; low-pass 94 Hz.
// For an accelerometer without gyroscope say none,0 in the hello and leave the rates out.
#include <Wire.h>

const uint8_t IMU = 0x68;
const unsigned long PERIOD_US = 10000;                // 100 Hz
const float ACCELERATION = 9.80665 / 16384.0;         // m/s2 of a count at 2 g
const float RATE = 3.14159265 / 180.0 / 131.0;        // rad/s of a count at 250 deg/s
char body[160];
uint16_t count = 0;
uint32_t next_us, hello_ms;

void put(uint8_t address, uint8_t value) {
  Wire.beginTransmission(IMU);
  Wire.write(address);
  Wire.write(value);
  Wire.endTransmission();
}

void send_body() {
  uint8_t sum = 0;
  for (char *c = body; *c; c++) sum ^= (uint8_t)*c;
  char end[8];
  snprintf(end, sizeof end, "*%02X\r\n", sum);
  Serial.print('$');
  Serial.print(body);
  Serial.print(end);
}

void hello() {
  strcpy(body, "CATHI,1,MPU-6050,m/s2,19.6133,rad/s,4.36332,100");
  send_body();
  hello_ms = millis();
}

void append(float value) {                            // snprintf of an Arduino knows no %f
  char text[16];
  dtostrf(value, 1, 5, text);
  strcat(body, ",");
  strcat(body, text);
}

int16_t word_from_wire() {
  int16_t high = Wire.read();
  return (high << 8) | (uint8_t)Wire.read();
}

void setup() {
  Serial.begin(115200);
  Wire.begin();
  Wire.setClock(400000);
  put(0x6B, 0x01);                                    // wake up, clock of the gyroscope
  put(0x1A, 0x02);                                    // low-pass 94 Hz
  put(0x1B, 0x00);                                    // 250 deg/s
  put(0x1C, 0x00);                                    // 2 g
  delay(100);
  hello();
  next_us = micros();
}

void loop() {
  while (Serial.available()) if (Serial.read() == '?') hello();
  if ((uint32_t)millis() - hello_ms >= 1000) hello();
  if ((int32_t)((uint32_t)micros() - next_us) < 0) return;
  next_us += PERIOD_US;
  Wire.beginTransmission(IMU);
  Wire.write(0x3B);
  if (Wire.endTransmission(false) != 0) return;       // not there: the host sees that samples stop
  unsigned long taken = micros();
  if (Wire.requestFrom(IMU, (uint8_t)14) != 14) return;
  int16_t raw[7];
  for (int i = 0; i < 7; i++) raw[i] = word_from_wire();   // 3 accelerations, temperature, 3 rates
  snprintf(body, sizeof body, "CATAC,%u,%lu", (unsigned)count++, taken);
  for (int i = 0; i < 3; i++) append(raw[i] * ACCELERATION);
  for (int i = 4; i < 7; i++) append(raw[i] * RATE);
  send_body();
}
